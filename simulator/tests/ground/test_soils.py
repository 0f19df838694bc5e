"""The picture of the ground: right size and frame, texture at every scale, wet lows, marks where the plan has them."""

from __future__ import annotations

from dataclasses import replace

import cv2
import numpy as np
import pytest
from laws import seeds

from standoff.core.homography import FloatArray
from standoff_sim.ground.canvas import Canvas, fractal
from standoff_sim.ground.ground_marks import draw_prints
from standoff_sim.ground.relief import make_relief
from standoff_sim.ground.soil_colours import PALETTES, palette_of
from standoff_sim.ground.soils import paint_ground
from standoff_sim.ground.terrain_plan import Path, Pit, Slab, Soil, TerrainPlan

_STRIP_M = (120.0, 40.0)
_SQUARE: Path = ((10.0, 15.0), (25.0, 15.0), (25.0, 30.0), (10.0, 30.0))


def painted(plan: TerrainPlan, seed: int = 0) -> tuple[FloatArray, FloatArray]:
    albedo, wetness = paint_ground(np.random.default_rng(seed), plan, make_relief(np.random.default_rng(seed), plan))
    return albedo.astype(np.float64), wetness.astype(np.float64)


def part(picture: FloatArray, low_m: tuple[float, float], high_m: tuple[float, float], extent_m: float) -> FloatArray:
    px = np.round((np.array([low_m, high_m]) / extent_m + 0.5) * len(picture)).astype(int)
    return picture[px[0, 1] : px[1, 1], px[0, 0] : px[1, 0]]


@pytest.mark.parametrize(("extent_m", "shape"), [((120.0, 120.0), (2048, 2048)), ((60.0, 30.0), (1024, 2048))])
def test_the_picture_covers_the_extent_with_square_texels(
    extent_m: tuple[float, float], shape: tuple[int, int]
) -> None:
    plan = TerrainPlan(extent_m=extent_m)
    albedo, wetness = paint_ground(np.random.default_rng(0), plan, make_relief(np.random.default_rng(0), plan))
    assert albedo.shape == (*shape, 3) and albedo.dtype == np.uint8
    assert wetness.shape == shape and wetness.dtype == np.uint8


@pytest.mark.parametrize("soil", list(Soil))
def test_soil_has_texture_from_a_hand_to_tens_of_metres(soil: Soil) -> None:
    albedo, _ = painted(TerrainPlan(extent_m=(120.0, 60.0), soil=soil), seed=3)
    grey = albedo.mean(axis=2)
    for wide_px in (1, 8, 64, 256):
        finer = cv2.blur(grey, (wide_px, wide_px)) if wide_px > 1 else grey
        detail = finer - cv2.blur(grey, (4 * wide_px, 4 * wide_px))
        assert detail.std() > 1.5, f"nothing to see at {wide_px} texels"
    assert 55.0 < grey.mean() < 215.0


@pytest.mark.parametrize("seed", seeds(3))
def test_dry_soil_is_paler_than_wet_soil(seed: int) -> None:
    dry, dry_wetness = painted(TerrainPlan(extent_m=_STRIP_M, moisture=0.0, puddles=0.0, grass=0.0), seed)
    wet, wet_wetness = painted(TerrainPlan(extent_m=_STRIP_M, moisture=1.0, puddles=0.05, grass=0.0), seed)
    assert dry.mean() > wet.mean() + 10.0
    assert dry_wetness.mean() < wet_wetness.mean()


@pytest.mark.parametrize("share", [0.0, 0.02, 0.08])
def test_puddles_cover_about_the_planned_share(share: float) -> None:
    _, wetness = painted(TerrainPlan(extent_m=_STRIP_M, puddles=share, moisture=0.2), seed=2)
    assert (wetness > 190.0).mean() == pytest.approx(share, abs=0.3 * share + 1e-4)


def test_water_gathers_in_ruts() -> None:
    ruts: tuple[Path, ...] = (((-50.0, -20.0), (50.0, -20.0)),)
    _, wetness = painted(TerrainPlan(ruts=ruts, puddles=0.03), seed=4)
    lanes = [part(wetness, (-48.0, y_m - 0.3), (48.0, y_m + 0.3), 120.0).mean() for y_m in (-21.0, -20.0, -19.0)]
    assert min(lanes[0], lanes[2]) > 1.5 * wetness.mean()
    assert lanes[1] < 0.5 * wetness.mean()


def test_row_zero_is_in_the_south_and_slabs_are_grey_concrete() -> None:
    plan = TerrainPlan(soil=Soil.RED_CLAY, grass=0.0)
    albedo, _ = painted(replace(plan, slabs=(Slab(_SQUARE, dirt=0.0, joint_m=0.0),)))
    slab = part(albedo, (13.0, 18.0), (22.0, 27.0), 120.0)
    mirrored = part(albedo, (13.0, -27.0), (22.0, -18.0), 120.0)
    assert np.ptp(slab.mean(axis=(0, 1))) < 20.0 < np.ptp(mirrored.mean(axis=(0, 1)))


def test_a_dirtier_slab_shows_more_soil() -> None:
    def redness(dirt: float) -> float:
        plan = TerrainPlan(soil=Soil.RED_CLAY, grass=0.0, slabs=(Slab(_SQUARE, dirt=dirt),))
        slab = part(painted(plan)[0], (11.0, 16.0), (24.0, 29.0), 120.0)
        return float((slab[..., 0] - slab[..., 2]).mean())

    assert redness(0.0) < redness(0.5) < redness(1.0)


def test_grass_grows_at_the_borders_and_not_on_roads() -> None:
    def greenness(picture: FloatArray) -> float:
        return float((picture[..., 1] - picture[..., 0]).mean())

    road: tuple[Path, ...] = (((-60.0, 0.0), (60.0, 0.0)),)
    plan = TerrainPlan(soil=Soil.GREY_GRAVEL, roads=road)
    seeds = range(2)
    bare = [painted(replace(plan, grass=0.0), seed)[0] for seed in seeds]
    green = [painted(replace(plan, grass=1.0), seed)[0] for seed in seeds]
    changed = [np.abs(a - b).mean(axis=2) > 12.0 for a, b in zip(bare, green, strict=True)]
    border = np.mean([part(change, (-60.0, 30.0), (-50.0, 60.0), 120.0).mean() for change in changed])
    middle = np.mean([part(change, (-15.0, 10.0), (15.0, 25.0), 120.0).mean() for change in changed])
    on_road = np.mean([part(change, (-55.0, -1.0), (-45.0, 1.0), 120.0).mean() for change in changed])
    assert border > 2.0 * middle
    assert on_road < 0.5 * border


def test_treads_are_printed_at_the_pitch_of_real_ones_along_a_track() -> None:
    plan = TerrainPlan(extent_m=(60.0, 60.0), tracks=(((-25.0, 0.0), (25.0, 0.0)),))
    canvas = Canvas.of(plan.extent_m, 2048)
    prints = draw_prints(np.random.default_rng(1), canvas, plan).astype(np.float64)
    lane = part(prints, (-20.0, -2.0), (20.0, 2.0), 60.0) - 128.0
    power = (np.abs(np.fft.rfft(lane - lane.mean(axis=1, keepdims=True), axis=1)) ** 2).sum(axis=0)
    waves_per_m = np.fft.rfftfreq(lane.shape[1], 1.0 / canvas.px_per_m)
    band = (waves_per_m > 1.0) & (waves_per_m < 8.0)
    assert 0.19 < 1.0 / waves_per_m[band][np.argmax(power[band])] < 0.34


def test_prints_leave_ground_without_traffic_as_it_is() -> None:
    prints = draw_prints(np.random.default_rng(0), Canvas.of((120.0, 120.0), 2048), TerrainPlan())
    assert (prints == 128).mean() > 0.8


@pytest.mark.parametrize("seed", seeds(3))
def test_a_fractal_has_zero_mean_and_unit_deviation(seed: int) -> None:
    field = fractal(np.random.default_rng(seed), (300, 500), 4, 256)
    assert field.shape == (300, 500)
    assert float(field.mean()) == pytest.approx(0.0, abs=0.1)
    assert float(field.std()) == pytest.approx(1.0, abs=0.1)


def test_a_canvas_puts_the_origin_in_the_middle_of_the_picture() -> None:
    canvas = Canvas.of((100.0, 50.0), 2000)
    assert canvas.shape == (1000, 2000)
    layer = np.zeros(canvas.shape, np.uint8)
    canvas.fill(layer, [np.array([[10.0, 5.0], [20.0, 5.0], [20.0, 15.0], [10.0, 15.0]])], 255)
    rows, columns = np.nonzero(layer > 127)
    assert columns.mean() == pytest.approx((15.0 / 100.0 + 0.5) * 2000 - 0.5, abs=0.5)
    assert rows.mean() == pytest.approx((10.0 / 50.0 + 0.5) * 1000 - 0.5, abs=0.5)
    window = canvas.window(np.array([[10.0, 5.0], [20.0, 15.0]]), 1.0)
    assert canvas.inside(np.array([[10.0, 5.0], [20.0, 5.0], [20.0, 15.0], [10.0, 15.0]]), window).sum() == layer.sum()


@pytest.mark.parametrize("soil", [soil for soil in Soil if soil is not Soil.MIXED])
def test_palettes_run_from_dark_to_pale_and_stay_within_what_soil_reflects(soil: Soil) -> None:
    brightness = palette_of(soil)[:, 0].astype(float).mean(axis=1)
    assert np.all(np.diff(brightness) >= 0.0)
    linear = (palette_of(soil) / 255.0) ** 2.2
    assert linear.min() > 0.003 and linear.max() < 0.85


def test_palettes_cannot_be_changed() -> None:
    for palette in PALETTES.values():
        assert not palette.flags.writeable


def test_pit_floors_do_not_grow_grass() -> None:
    plan = TerrainPlan(soil=Soil.OCHRE_SAND, grass=1.0, pits=(Pit(_SQUARE, 1.0),))
    floor = part(painted(plan)[0], (12.0, 17.0), (23.0, 28.0), 120.0)
    assert float((floor[..., 1] > floor[..., 0]).mean()) < 0.1
