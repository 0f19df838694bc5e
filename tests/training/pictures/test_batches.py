from __future__ import annotations

import multiprocessing
import pickle
from dataclasses import replace
from pathlib import Path

import cv2
import numpy as np
import pytest
import torch
from scipy import stats
from training.drawn_pictures import draw_boxes, draw_ellipses, label

from standoff.core.errors import DataError
from standoff.labels import LabelledPicture
from standoff.training.pictures.augment import AugmentParams, Sample
from standoff.training.pictures.batches import Batch, draw_chances, open_batches, stack_samples

_TENSORS = ("pictures", "boxes", "class_id", "ignored", "picture")


@pytest.fixture(scope="module")
def drawn(tmp_path_factory: pytest.TempPathFactory) -> list[LabelledPicture]:
    folder = tmp_path_factory.mktemp("drawn")
    rng = np.random.default_rng(0)
    pictures = [label(draw_boxes(rng), folder / f"{number}.jpg") for number in range(6)]
    for picture in pictures:
        cv2.imwrite(str(picture.path), draw_ellipses(picture.xyxy_px))
    return pictures


def _size_px(step: int) -> tuple[int, int]:
    return (160, 96) if step % 2 else (96, 128)


def _made(data: list[LabelledPicture], first: int, last: int, workers: int, seed: int = 7) -> list[Batch]:
    opened = open_batches(
        data,
        params=AugmentParams(),
        batch=3,
        sizes_px=_size_px,
        seed=seed,
        first_step=first,
        last_step=last,
        workers=workers,
    )
    with opened as batches:
        return list(batches)


def _assert_equal(batch: Batch, other: Batch) -> None:
    assert batch.step == other.step
    assert all(torch.equal(getattr(batch, name), getattr(other, name)) for name in _TENSORS)


@pytest.mark.filterwarnings("ignore:This DataLoader will create")  # of more workers than the machine has cores
@pytest.mark.parametrize("workers", [0, 1, 2])
def test_a_resumed_run_sees_the_same_pictures_with_any_number_of_workers(
    drawn: list[LabelledPicture], workers: int
) -> None:
    whole = _made(drawn, 0, 5, 0)
    assert [batch.step for batch in whole] == [0, 1, 2, 3, 4, 5]
    resumed = _made(drawn, 3, 5, workers)
    assert len(resumed) == 3
    for batch, again in zip(whole[3:], resumed, strict=True):
        _assert_equal(batch, again)
    assert not torch.equal(whole[1].pictures, whole[3].pictures)
    assert not torch.equal(whole[3].pictures, _made(drawn, 3, 3, 0, seed=8)[0].pictures)


def test_a_batch_has_the_size_of_its_step_and_boxes_that_know_their_picture(drawn: list[LabelledPicture]) -> None:
    for batch in _made(drawn, 0, 3, 1):
        width, height = _size_px(batch.step)
        assert batch.pictures.shape == (3, 3, height, width)
        assert batch.pictures.dtype == torch.uint8
        assert batch.pictures.is_contiguous(memory_format=torch.channels_last)
        assert batch.boxes.dtype == torch.float32
        assert batch.boxes.shape == (len(batch.class_id), 4)
        assert batch.class_id.dtype == batch.picture.dtype == torch.int64
        assert batch.ignored.dtype == torch.bool
        assert len(batch.ignored) == len(batch.picture) == len(batch.class_id)
        assert (batch.picture.diff() >= 0).all()
        assert set(batch.picture.tolist()) <= {0, 1, 2}
        assert not batch.problems


def test_samples_are_stacked_red_first_with_their_boxes(drawn: list[LabelledPicture]) -> None:
    samples = []
    for number, picture in enumerate(drawn[:3]):
        image = np.full((90, 160, 3), (10, 20, 200), np.uint8)
        boxes, classes, ignored = picture.xyxy_px[:number], picture.class_id[:number], picture.ignored[:number]
        samples.append(Sample(image, boxes, classes, ignored, picture.foot_px[:number]))
    batch = stack_samples(samples)
    assert batch.pictures[1, :, 40, 80].tolist() == [200, 20, 10]
    assert batch.picture.tolist() == [1, 2, 2]
    np.testing.assert_allclose(batch.boxes[1:], samples[2].xyxy_px, rtol=1e-6)


@pytest.mark.parametrize("workers", [0, 1])
def test_a_corrupt_picture_is_named_and_replaced(drawn: list[LabelledPicture], tmp_path: Path, workers: int) -> None:
    corrupt = replace(drawn[0], path=tmp_path / "corrupt.jpg")
    corrupt.path.write_bytes(drawn[0].path.read_bytes()[:400])
    missing = replace(drawn[0], path=tmp_path / "missing.jpg")
    batches = _made([corrupt, missing, drawn[1]], 0, 2, workers)
    assert all(len(batch.pictures) == 3 for batch in batches)
    problems = [problem for batch in batches for problem in batch.problems]
    assert {problem.path for problem in problems} == {corrupt.path, missing.path}
    assert all(problem.skipped_picture and problem.kind == "unreadable picture" for problem in problems)


@pytest.mark.parametrize("workers", [0, 1])
def test_an_error_of_a_worker_keeps_its_kind(drawn: list[LabelledPicture], tmp_path: Path, workers: int) -> None:
    with pytest.raises(DataError, match=r"nowhere\.jpg"):
        _made([replace(drawn[0], path=tmp_path / "nowhere.jpg")], 0, 1, workers)


def test_no_pictures_are_an_error() -> None:
    with pytest.raises(DataError, match="expected training pictures, found none"):
        _made([], 0, 1, 0)


def test_workers_end_with_the_block_and_need_not_be_drained(drawn: list[LabelledPicture]) -> None:
    opened = open_batches(
        drawn,
        params=AugmentParams(),
        batch=2,
        sizes_px=_size_px,
        seed=0,
        first_step=0,
        last_step=10_000_000,
        workers=1,
    )
    with opened as batches:
        assert next(batches).step == 0
        assert len(multiprocessing.active_children()) == 1
    assert not multiprocessing.active_children()


def test_batches_travel_between_processes(drawn: list[LabelledPicture]) -> None:
    (batch,) = _made(drawn, 4, 4, 0)
    _assert_equal(batch, pickle.loads(pickle.dumps(batch)))
    _assert_equal(batch, batch.to(torch.device("cpu")))


def _with_classes(*class_ids: int, weight: float = 1.0) -> LabelledPicture:
    picture = label(np.tile([10.0, 10.0, 20.0, 30.0], (len(class_ids), 1)))
    return replace(picture, class_id=np.array(class_ids, np.int64), weight=weight)


def test_without_rare_classes_the_weights_decide() -> None:
    data = [_with_classes(0, weight=1.0), _with_classes(1, weight=3.0), _with_classes(weight=4.0)]
    np.testing.assert_allclose(draw_chances(data, 0.0), [0.125, 0.375, 0.5])
    np.testing.assert_allclose(draw_chances(data, 0.1), [0.125, 0.375, 0.5])


def test_a_class_on_one_picture_of_a_hundred_is_drawn_as_the_square_root_says() -> None:
    data = [_with_classes(0) for _ in range(99)] + [_with_classes(0, 0, 2)]
    chances = draw_chances(data, 0.16)
    assert chances.sum() == pytest.approx(1.0)
    np.testing.assert_allclose(chances[-1] / chances[0], 4.0)


def test_ignored_things_do_not_make_a_picture_rare() -> None:
    data = [_with_classes(0) for _ in range(99)] + [replace(_with_classes(5), ignored=np.array([True]))]
    np.testing.assert_allclose(draw_chances(data, 0.5), 0.01)


def test_pictures_are_drawn_by_their_chances(drawn: list[LabelledPicture], monkeypatch: pytest.MonkeyPatch) -> None:
    weights = [1.0, 2.0, 3.0, 4.0, 0.0, 10.0]
    data = [replace(picture, weight=weight) for picture, weight in zip(drawn, weights, strict=True)]
    counts = dict.fromkeys((picture.path for picture in data), 0)

    def load(picture: LabelledPicture, reduction: int) -> np.ndarray[tuple[int, ...], np.dtype[np.uint8]]:
        counts[picture.path] += 1
        return np.zeros((360, 640, 3), np.uint8)

    monkeypatch.setattr("standoff.training.pictures.batches.load_picture", load)
    _made(data, 0, 120, 0)
    expected = np.array(weights) / sum(weights) * sum(counts.values())
    seen = np.array(list(counts.values()))
    assert seen[4] == 0
    assert stats.chisquare(np.delete(seen, 4), np.delete(expected, 4)).pvalue > 0.01
