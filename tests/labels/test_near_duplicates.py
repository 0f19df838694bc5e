from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
from labelled_sets import write_mixture

from standoff.core.types import ImageArray
from standoff.labels import LabelledData, LabelledPicture, Split, read_data
from standoff.labels.near_duplicates import MAX_BITS, hash_picture, near_duplicates


def _scene(seed: int) -> ImageArray:
    """Return blobs of all sizes, as different from seed to seed as two places are."""
    rng = np.random.default_rng(seed)
    layers = [cv2.resize(rng.normal(0, 30, (9 * n, 16 * n)), (640, 360)) for n in (1, 2, 4)]
    return np.asarray(np.clip(128 + sum(layers), 0, 255), np.uint8)


def _sand(seed: int) -> ImageArray:
    """Return even ground with grain, darker towards the corners as every lens makes it."""
    rng = np.random.default_rng(seed)
    y, x = np.mgrid[-1:1:360j, -1:1:640j]
    grain = cv2.GaussianBlur(rng.normal(0, 1, (360, 640)), (0, 0), 2.0) * rng.uniform(10, 40)
    return np.asarray(np.clip(150 + grain - rng.uniform(5, 40) * (x**2 + y**2), 0, 255), np.uint8)


def _data(folder: Path, **pictures: list[ImageArray]) -> LabelledData:
    splits: dict[Split, tuple[LabelledPicture, ...]] = {"train": (), "val": (), "test": ()}
    for split in splits:
        labelled = []
        for number, image in enumerate(pictures.get(split, ())):
            path = folder / f"{split}{number}.jpg"
            assert cv2.imwrite(str(path), image)
            none = np.zeros(0, np.int64)
            size_px = image.shape[1], image.shape[0]
            labelled.append(LabelledPicture(path, size_px, np.zeros((0, 4)), none, none.astype(np.bool_), "g", "s"))
        splits[split] = tuple(labelled)
    return LabelledData(("worker",), splits, [])


@pytest.mark.parametrize("seed", range(3))
def test_copies_across_splits_are_found_with_their_originals(tmp_path: Path, seed: int) -> None:
    scenes = [_scene(10 * seed + number) for number in range(8)]
    brighter = cv2.convertScaleAbs(scenes[3], alpha=1.1, beta=10)
    smaller = cv2.resize(scenes[5], (320, 180), interpolation=cv2.INTER_AREA)
    moved = np.roll(scenes[6], 6, axis=1)
    data = _data(tmp_path, train=scenes[:7], val=[scenes[7], brighter, moved], test=[smaller, _scene(1000 + seed)])
    pairs = near_duplicates(data)
    found = {(pair.train.stem, pair.held_out.stem, pair.split) for pair in pairs}
    assert found == {("train3", "val1", "val"), ("train6", "val2", "val"), ("train5", "test0", "test")}
    assert [pair.bits for pair in pairs] == sorted(pair.bits for pair in pairs)
    assert list(near_duplicates(data, max_bits=pairs[0].bits)) == [pair for pair in pairs if pair.bits == pairs[0].bits]


def test_pictures_of_a_few_pixels_are_passed_over(tmp_path: Path) -> None:
    data = _data(tmp_path, train=[_scene(1)], val=[_scene(1)])
    sides_px: dict[Split, int] = {"train": 1, "val": 3}
    for split, side_px in sides_px.items():
        path = tmp_path / f"{split}-speck.png"
        assert cv2.imwrite(str(path), np.zeros((side_px, side_px, 3), np.uint8))
        data.splits[split] += (replace(data.splits[split][0], path=path, size_px=(side_px, side_px)),)
    assert [pair.train.stem for pair in near_duplicates(data)] == ["train0"]


def test_blank_ground_does_not_flood_the_list(tmp_path: Path) -> None:
    sand = [_sand(seed) for seed in range(20)]
    flat = [np.full((360, 640), level, np.uint8) for level in (90, 150, 200, 90)]
    data = _data(tmp_path, train=sand[:10] + flat[:2], val=sand[10:] + flat[2:])
    assert sum(hash_picture(image) is not None for image in sand) > 10
    assert list(near_duplicates(data)) == []


def test_every_picture_is_reported_and_those_that_cannot_be_read_are_passed_over(tmp_path: Path) -> None:
    data = _data(tmp_path, train=[_scene(1), _scene(2)], val=[_scene(1)])
    data.splits["train"][1].path.write_bytes(b"broken")
    seen = []
    assert len(near_duplicates(data, on_picture=lambda: seen.append(1))) == 1
    assert len(seen) == 3
    assert list(near_duplicates(_data(tmp_path, val=[_scene(1)]))) == []


@pytest.mark.shared
def test_frames_of_one_flight_are_near_duplicates_and_of_two_flights_are_not(shared_data: Path, tmp_path: Path) -> None:
    source: dict[str, object] = {"path": str(shared_data / "aerial_vehicles"), "names": ["a", "b", "c", "d", "e"]}
    by_flight = read_data(write_mixture(tmp_path / "m.yaml", source))
    assert list(near_duplicates(by_flight)) == []
    # every second frame held out, as a split by picture does
    source["group"] = "(.*)"
    source["groups"] = {"val": [f"DJI_0005-0{number}" for number in (166, 124, 186, 203)]}
    pairs = near_duplicates(read_data(write_mixture(tmp_path / "m.yaml", source)))
    assert len(pairs) == 4
    assert all(pair.train.stem.startswith("DJI_0005-") and pair.bits < MAX_BITS / 2 for pair in pairs)
