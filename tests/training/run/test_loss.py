from __future__ import annotations

import math
from dataclasses import replace

import numpy as np
import pytest
import torch
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from tolerances import FLOAT32_LOSS_REL

from standoff.training.darknet.layers import Yolo
from standoff.training.pictures.batches import Batch
from standoff.training.run.loss import LossParams, complete_iou, yolo_loss

CLASSES = 3
FINE = Yolo(line=1, anchors_px=((8.0, 16.0), (16.0, 8.0)), classes=CLASSES, scale_xy=1.0)
COARSE = Yolo(line=2, anchors_px=((40.0, 40.0), (60.0, 30.0)), classes=CLASSES, scale_xy=1.0)
HEADS = (FINE, COARSE)
SIZE_PX = (96, 64)
STRICT = LossParams(box_weight=1.0, anchor_iou=1.0)
"""One anchor a truth, every term as it is."""


def _raw(seed: int, pictures: int = 2) -> tuple[torch.Tensor, ...]:
    generator = torch.Generator().manual_seed(seed)
    sizes = ((SIZE_PX[1] // 8, SIZE_PX[0] // 8), (SIZE_PX[1] // 16, SIZE_PX[0] // 16))
    return tuple(
        torch.randn(pictures, 2 * (5 + CLASSES), *size, generator=generator, dtype=torch.float32).requires_grad_()
        for size in sizes
    )


def _batch(boxes: list[list[float]], class_id: list[int], picture: list[int], ignored: list[bool]) -> Batch:
    return Batch(
        pictures=torch.zeros(2, 3, SIZE_PX[1], SIZE_PX[0], dtype=torch.uint8),
        boxes=torch.tensor(boxes, dtype=torch.float32).reshape(-1, 4),
        class_id=torch.tensor(class_id, dtype=torch.int64),
        ignored=torch.tensor(ignored, dtype=torch.bool),
        feet=torch.full((len(boxes), 2), torch.nan),
        picture=torch.tensor(picture, dtype=torch.int64),
    )


def _some_truth(seed: int) -> Batch:
    rng = np.random.default_rng(seed)
    count = 5
    centre = rng.uniform([12.0, 12.0], [84.0, 52.0], (count, 2))
    # Near the shape of one anchor each and of no second.
    size = np.array([(8, 16), (16, 8), (40, 40), (60, 30), (9, 15)]) * rng.uniform(0.95, 1.05, (count, 2))
    boxes = np.concatenate([centre - size / 2, centre + size / 2], axis=1)
    picture = np.sort(rng.integers(0, 2, count))
    return _batch(boxes.tolist(), rng.integers(0, CLASSES, count).tolist(), picture.tolist(), [False] * count)


def _sigmoid(value: float) -> float:
    return 1.0 / (1.0 + math.exp(-value))


def _iou(first: list[float], second: list[float]) -> float:
    width = max(0.0, min(first[2], second[2]) - max(first[0], second[0]))
    height = max(0.0, min(first[3], second[3]) - max(first[1], second[1]))
    areas = [(box[2] - box[0]) * (box[3] - box[1]) for box in (first, second)]
    return width * height / (sum(areas) - width * height)


def _literal(heads: tuple[torch.Tensor, ...], batch: Batch, params: LossParams) -> tuple[float, float, float]:
    """Follow Darknet's forward_yolo_layer cell by cell: squared box error, logistic objectness and classes."""
    box_sum = objectness_sum = class_sum = 0.0
    anchors = [(layer, number) for layer in range(2) for number in range(2)]
    owner: dict[tuple[int, int, int, int, int], list[int]] = {}
    for truth, (left, top, right, bottom) in enumerate(batch.boxes.tolist()):
        width, height = right - left, bottom - top
        shapes = [HEADS[layer].anchors_px[number] for layer, number in anchors]
        fits = [_iou([0, 0, width, height], [0, 0, *shape]) for shape in shapes]
        layer, number = anchors[int(np.argmax(fits))]
        cell_px = SIZE_PX[0] / heads[layer].shape[3]
        row, column = int((top + bottom) / 2 / cell_px), int((left + right) / 2 / cell_px)
        owner.setdefault((layer, int(batch.picture[truth]), number, row, column), []).append(truth)
    for layer, head in enumerate(heads):
        pictures, _, rows, columns = head.shape
        cell_px = SIZE_PX[0] / columns
        said = head.detach().reshape(pictures, 2, 5 + CLASSES, rows, columns).tolist()
        for picture, number, row, column in np.ndindex(pictures, 2, rows, columns):
            x, y, w, h, objectness, *classes = (
                said[picture][number][value][row][column] for value in range(5 + CLASSES)
            )
            anchor = HEADS[layer].anchors_px[number]
            centre = (column + _sigmoid(x)) * cell_px, (row + _sigmoid(y)) * cell_px
            half = anchor[0] * math.exp(w) / 2, anchor[1] * math.exp(h) / 2
            predicted = [centre[0] - half[0], centre[1] - half[1], centre[0] + half[0], centre[1] + half[1]]
            own = owner.get((layer, picture, number, row, column), [])
            best = max(
                (
                    _iou(predicted, box)
                    for box, where in zip(batch.boxes.tolist(), batch.picture.tolist(), strict=True)
                    if where == picture
                ),
                default=0.0,
            )
            if own:
                objectness_sum += -math.log(_sigmoid(objectness))
            elif best <= params.ignore_iou:
                objectness_sum += -math.log(1.0 - _sigmoid(objectness))
            for truth in own:
                left, top, right, bottom = batch.boxes[truth].tolist()
                share = (right - left) * (bottom - top) / (SIZE_PX[0] * SIZE_PX[1])
                wanted = (left + right) / 2 / cell_px - column, (top + bottom) / 2 / cell_px - row
                scale = math.log((right - left) / anchor[0]), math.log((bottom - top) / anchor[1])
                errors = (_sigmoid(x) - wanted[0], _sigmoid(y) - wanted[1], w - scale[0], h - scale[1])
                box_sum += (2.0 - share) * sum(error**2 for error in errors)
                for index, value in enumerate(classes):
                    is_it = index == int(batch.class_id[truth])
                    class_sum += -math.log(_sigmoid(value) if is_it else 1.0 - _sigmoid(value))
    return box_sum / 2, objectness_sum / 2, class_sum / 2


@pytest.mark.parametrize("seed", range(6))
def test_the_papers_loss_is_what_darknet_computes_cell_by_cell(seed: int) -> None:
    params = replace(STRICT, box="squared")
    heads, batch = _raw(seed), _some_truth(seed)
    terms = yolo_loss(heads, HEADS, batch, params)
    box, objectness, classes = _literal(heads, batch, params)
    assert terms.box.item() == pytest.approx(box, rel=FLOAT32_LOSS_REL)
    assert terms.objectness.item() == pytest.approx(objectness, rel=FLOAT32_LOSS_REL)
    assert terms.classes.item() == pytest.approx(classes, rel=FLOAT32_LOSS_REL)
    assert terms.total.item() == pytest.approx(box + objectness + classes, rel=FLOAT32_LOSS_REL)


@pytest.mark.parametrize("box", ["ciou", pytest.param("squared", marks=pytest.mark.live)])
def test_gradient_descent_on_the_heads_finds_the_truth(box: str) -> None:
    heads, batch = _raw(3), _some_truth(3)
    params = LossParams(box=box, anchor_iou=1.0)  # type: ignore[arg-type] # a Literal
    descent = torch.optim.Adam(heads, lr=0.1)
    before = yolo_loss(heads, HEADS, batch, params).total.item()
    for _ in range(250):
        descent.zero_grad()
        torch.autograd.backward(yolo_loss(heads, HEADS, batch, params).total)
        descent.step()
    assert yolo_loss(heads, HEADS, batch, params).total.item() < 0.02 * before


def test_an_ignored_region_neither_attracts_nor_repels() -> None:
    heads = _raw(5)
    whole = [0.0, 0.0, float(SIZE_PX[0]), float(SIZE_PX[1])]
    batch = _batch([whole, whole], [0, 0], [0, 1], [True, True])
    terms = yolo_loss(heads, HEADS, batch, STRICT)
    assert terms.total.item() == 0.0
    torch.autograd.backward(terms.total)
    assert all(head.grad is not None and not head.grad.any() for head in heads)


def test_the_class_id_of_an_ignored_region_does_not_count() -> None:
    heads, box = _raw(6), [20.0, 20.0, 30.0, 36.0]
    losses = {
        yolo_loss(heads, HEADS, _batch([box], [class_id], [0], [True]), STRICT).total.item()
        for class_id in range(CLASSES)
    }
    assert len(losses) == 1


def test_a_picture_without_anything_still_teaches_that_there_is_nothing() -> None:
    heads = _raw(7)
    terms = yolo_loss(heads, HEADS, _batch([], [], [], []), STRICT)
    assert terms.objectness.item() > 0 and terms.box.item() == 0 and terms.classes.item() == 0
    torch.autograd.backward(terms.total)
    assert all(head.grad is not None for head in heads)


def test_more_anchors_learn_a_truth_when_they_fit_it() -> None:
    heads, batch = _raw(8), _batch([[20.0, 20.0, 32.0, 32.0]], [1], [0], [False])
    one = yolo_loss(heads, HEADS, batch, STRICT).classes.item()
    more = yolo_loss(heads, HEADS, batch, replace(STRICT, anchor_iou=0.4)).classes.item()
    assert more > one


def test_twice_the_same_pictures_give_the_same_loss() -> None:
    """It is a mean over pictures, so that accumulated gradients are those of one large batch."""
    heads = _raw(9, pictures=1)
    one = _batch([[20.0, 20.0, 29.0, 35.0]], [1], [0], [False])
    one = replace(one, pictures=one.pictures[:1])
    two = replace(
        one,
        pictures=torch.cat([one.pictures] * 2),
        boxes=torch.cat([one.boxes] * 2),
        class_id=torch.cat([one.class_id] * 2),
        ignored=torch.cat([one.ignored] * 2),
        feet=torch.full((2 * len(one.boxes), 2), torch.nan),
        picture=torch.tensor([0, 1]),
    )
    doubled = tuple(torch.cat([head] * 2) for head in heads)
    assert yolo_loss(doubled, HEADS, two, STRICT).total.item() == pytest.approx(
        yolo_loss(heads, HEADS, one, STRICT).total.item(), rel=FLOAT32_LOSS_REL
    )


@examples(60)
@given(st.lists(st.floats(1.0, 100.0), min_size=8, max_size=8))
def test_complete_iou_is_what_its_paper_says(numbers: list[float]) -> None:
    first = [numbers[0], numbers[1], numbers[0] + numbers[2], numbers[1] + numbers[3]]
    second = [numbers[4], numbers[5], numbers[4] + numbers[6], numbers[5] + numbers[7]]
    iou = _iou(first, second)
    centres = [((box[0] + box[2]) / 2, (box[1] + box[3]) / 2) for box in (first, second)]
    around = max(first[2], second[2]) - min(first[0], second[0]), max(first[3], second[3]) - min(first[1], second[1])
    distance = math.dist(*centres) ** 2 / (around[0] ** 2 + around[1] ** 2)
    shape = 4 / math.pi**2 * (math.atan(numbers[6] / numbers[7]) - math.atan(numbers[2] / numbers[3])) ** 2
    expected = iou - distance - (shape / (1 - iou + shape) * shape if shape > 0 else 0.0)
    found = complete_iou(torch.tensor([first]), torch.tensor([second])).item()
    assert found == pytest.approx(expected, abs=FLOAT32_LOSS_REL)
