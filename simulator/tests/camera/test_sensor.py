from __future__ import annotations

from dataclasses import replace
from pathlib import Path
from typing import get_args

import av
import numpy as np
import pytest
from tolerances import SWSCALE_LEVELS

from standoff.core.types import ImageArray
from standoff.stages.frames import open_source
from standoff_sim.camera.sensor import Sensor, VideoWriter, drone_bit_rate_bps
from standoff_sim.clip.presets import Condition

CONDITIONS: tuple[Condition, ...] = get_args(Condition)
PLAIN = replace(Sensor.of("noon"), smear_levels=0.0, sharpening=0.0)
SIZE_PX = (320, 180)


def _grey(level: int, size_px: tuple[int, int] = (640, 480)) -> ImageArray:
    return np.full((size_px[1], size_px[0], 3), level, dtype=np.uint8)


def _picture(seed: int, size_px: tuple[int, int] = SIZE_PX) -> ImageArray:
    width, height = size_px
    x, y = np.meshgrid(np.arange(width), np.arange(height))
    waves = [np.sin(x / (17 + k) + seed) * np.cos(y / (23 - k)) for k in range(3)]
    return (np.stack(waves, axis=-1) * 80 + 128).astype(np.uint8)


@pytest.mark.parametrize("iso", [100.0, 800.0, 3200.0])
@pytest.mark.parametrize("level", [40, 120, 200])
def test_noise_is_as_strong_as_the_sensors_statistics_say(iso: float, level: int) -> None:
    sensor = replace(PLAIN, iso=iso)
    noise = sensor.expose(_grey(level), np.random.default_rng(1)).astype(float) - level
    # rounding to 8 bits adds a twelfth
    expected = np.hypot(sensor.noise_levels()[level], np.sqrt(1 / 12))
    assert noise.std() == pytest.approx(expected, rel=0.08)
    assert abs(noise.mean()) < 0.1


def test_noise_is_fine_in_brightness_and_blotchy_in_colour() -> None:
    noise = replace(PLAIN, iso=6400.0).expose(_grey(128), np.random.default_rng(1)).astype(float) - 128
    luma, chroma = noise.mean(axis=2), noise[..., 0] - noise[..., 2]

    def kept(channel: np.ndarray[tuple[int, int], np.dtype[np.float64]]) -> float:
        """Return the share of the deviation that averaging over 4x4 pixels leaves."""
        blocks = channel.reshape(120, 4, 160, 4).mean(axis=(1, 3))
        return float(blocks.std() / channel.std())

    assert kept(chroma) > 1.5 * kept(luma)
    assert luma.std() > chroma.std()


def test_every_frame_has_its_own_noise_and_the_same_generator_the_same() -> None:
    sensor = Sensor.of("dusk")
    first, again, other = (sensor.expose(_grey(90), np.random.default_rng(seed)) for seed in (1, 1, 2))
    np.testing.assert_array_equal(first, again)
    correlation = np.corrcoef(first[..., 1].ravel(), other[..., 1].ravel())[0, 1]
    assert abs(correlation) < 0.05


def test_noise_covers_pictures_larger_than_its_tile_without_seams() -> None:
    noise = replace(PLAIN, iso=6400.0).expose(_grey(128, (2300, 1200)), np.random.default_rng(3)).astype(float)
    columns, rows = noise.std(axis=(0, 2)), noise.std(axis=(1, 2))
    for deviations in (columns, rows):
        assert deviations.min() > 0.8 * deviations.mean()
        assert deviations.max() < 1.2 * deviations.mean()


def test_sharpening_leaves_halos_beside_edges() -> None:
    image = _grey(80)
    image[:, 320:] = 170
    quiet = replace(PLAIN, full_well=1e9)
    plain, sharp = (replace(quiet, sharpening=share).expose(image, np.random.default_rng(0)) for share in (0.0, 0.8))
    assert plain.max() <= 171
    assert sharp[:, 320:330].max() > 176
    assert sharp[:, 310:320].min() < 74


def test_denoising_smears_faint_texture_and_keeps_strong_edges() -> None:
    texture = (128 + 3 * (-1.0) ** np.add.outer(np.arange(480), np.arange(640)))[..., None].repeat(3, axis=2)
    image = texture.astype(np.uint8)
    image[:, 320:] += 60
    quiet = replace(PLAIN, full_well=1e9, softness_px=0.3)
    kept, smeared = (
        replace(quiet, smear_levels=levels).expose(image, np.random.default_rng(0)) for levels in (0.0, 12.0)
    )
    assert smeared[50:-50, 50:300].std() < 0.4 * kept[50:-50, 50:300].std()
    steps = [np.diff(made[240, 300:340, 1].astype(int)).max() for made in (kept, smeared)]
    assert steps[1] > 0.6 * steps[0]


def test_jpeg_costs_a_little_and_more_at_low_quality() -> None:
    image, rng = _picture(1, (640, 480)), np.random.default_rng
    plain = PLAIN.expose(image, rng(0)).astype(int)
    losses = [np.abs(replace(PLAIN, jpeg_quality=quality).expose(image, rng(0)) - plain).mean() for quality in (95, 50)]
    assert 0.0 < losses[0] < losses[1] < 6.0


@pytest.mark.parametrize("condition", CONDITIONS)
def test_cameras_of_every_light_work_and_dusk_is_the_noisiest(condition: Condition) -> None:
    noise = [
        sensor.expose(_grey(60), np.random.default_rng(0)).std() for sensor in (Sensor.of(condition), Sensor.of("dusk"))
    ]
    assert 0.0 < noise[0] <= noise[1]
    drawn = Sensor.draw(np.random.default_rng(4), condition)
    assert drawn.iso >= 100.0
    assert drawn.iso == Sensor.draw(np.random.default_rng(4), condition).iso


def test_the_exposure_drifts_slowly_about_right() -> None:
    factor = np.array([Sensor.of("noon").exposure_at(time_s) for time_s in np.arange(0.0, 100.0, 1 / 30).tolist()])
    assert 0.005 < factor.std() < 0.1
    assert np.abs(np.diff(factor)).max() < 0.01
    assert np.log(factor).mean() == pytest.approx(0.0, abs=0.02)


@pytest.mark.parametrize("varies", [False, True])
def test_a_written_video_has_exactly_its_times(tmp_path: Path, varies: bool) -> None:
    intervals_s = np.random.default_rng(2).uniform(0.01, 0.2, 20) if varies else np.full(20, 1 / 30)
    times_s = np.cumsum(intervals_s) - intervals_s[0]
    with VideoWriter(tmp_path / "video.mp4", SIZE_PX) as video:
        for index, time_s in enumerate(times_s.tolist()):
            video.write(_picture(index), time_s)
    with open_source(tmp_path / "video.mp4") as source:
        read_s = [frame.time_s for frame in source]
    np.testing.assert_allclose(read_s, np.round(times_s * 60_000) / 60_000, rtol=0, atol=1e-12)
    assert [path.name for path in tmp_path.iterdir()] == ["video.mp4"]


def test_a_written_video_looks_like_what_was_written(tmp_path: Path) -> None:
    with VideoWriter(tmp_path / "video.mp4", SIZE_PX, bit_rate_bps=4_000_000) as video:
        for index in range(6):
            video.write(_picture(3), index / 30)
    with open_source(tmp_path / "video.mp4") as source:
        last = list(source)[-1].image
    np.testing.assert_allclose(
        last.reshape(-1, 3).mean(axis=0), _picture(3).reshape(-1, 3).mean(axis=0), atol=SWSCALE_LEVELS
    )
    assert np.abs(last.astype(int) - _picture(3)).mean() < 6.0
    with av.open(str(tmp_path / "video.mp4")) as container:
        frame = next(container.decode(video=0))
        assert (frame.colorspace, frame.color_range, frame.format.name) == (1, 1, "yuv420p")


def test_a_video_has_about_the_bit_rate_asked_for(tmp_path: Path) -> None:
    noise = np.random.default_rng(0).integers(0, 256, (12, 180, 320, 3), dtype=np.uint8)
    with VideoWriter(tmp_path / "video.mp4", SIZE_PX, bit_rate_bps=1_500_000) as video:
        for index in range(120):
            video.write(noise[index % 12], index / 30)
    assert (tmp_path / "video.mp4").stat().st_size * 8 / 4.0 == pytest.approx(1_500_000, rel=0.25)
    assert 50e6 < drone_bit_rate_bps((3840, 2160)) < 60e6
    assert 12e6 < drone_bit_rate_bps((1920, 1080)) < 20e6


@pytest.mark.parametrize("written", [0, 5])
def test_an_interrupted_writer_leaves_nothing(tmp_path: Path, written: int) -> None:
    def work() -> None:
        with VideoWriter(tmp_path / "video.mp4", SIZE_PX) as video:
            for index in range(written):
                video.write(_picture(index), index / 30)
            raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        work()
    assert list(tmp_path.iterdir()) == []


def test_a_killed_writer_leaves_no_file_of_the_final_name(tmp_path: Path) -> None:
    video = VideoWriter(tmp_path / "video.mp4", SIZE_PX)
    for index in range(5):
        video.write(_picture(index), index / 30)
    assert not (tmp_path / "video.mp4").exists()
    video.abort()
    video.abort()
    assert list(tmp_path.iterdir()) == []
