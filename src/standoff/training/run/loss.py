"""The loss of YOLOv3, over raw heads.

Source:
    Redmon and Farhadi, YOLOv3: An Incremental Improvement, 2018, section 2.1 (one anchor a truth, logistic objectness
    and classes, predictions that overlap a truth are not negatives); the complete IoU of Zheng et al., Distance-IoU
    Loss, 2020, eq. 10 and 11; several anchors a truth as in Bochkovskiy et al., YOLOv4, 2020, section 3.4. The ground
    point with its error: see `standoff.training.run.point_loss`.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Annotated, Literal

import torch
from annotated_types import Gt, Interval
from torch import Tensor
from torch.nn import functional
from typing_extensions import Doc

from standoff.training.darknet.layers import POINT_VALUES, Yolo
from standoff.training.darknet.network import points_of
from standoff.training.pictures.batches import Batch
from standoff.training.run.point_loss import point_loss

BoxLoss = Literal["ciou", "squared"]
_LARGEST_LOG_SCALE = 6.0
"""A box more than 400 times its anchor is nonsense; exp of more would be infinite in a young network."""


@dataclass(frozen=True, slots=True)
class LossParams:
    """Settings of the loss."""

    box: Annotated[BoxLoss, Doc("Box term: complete IoU, or the paper's squared error.")] = "ciou"
    box_weight: Annotated[float, Gt(0), Doc("Of the box term.")] = 2.0
    objectness_weight: Annotated[float, Gt(0), Doc("Of the objectness term.")] = 1.0
    class_weight: Annotated[float, Gt(0), Doc("Of the class term.")] = 1.0
    point_weight: Annotated[float, Gt(0), Doc("Of the term of ground points, where the heads have them.")] = 1.0
    ignore_iou: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("Predictions that overlap a truth more are not called wrong; 0.5 in the paper."),
    ] = 0.6
    anchor_iou: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("Anchors whose shape has this IoU with a truth learn it besides the best one; 1 is the paper's best only."),
    ] = 0.3


@dataclass(frozen=True, slots=True)
class LossTerms:
    """Terms of the loss, each a sum over a batch divided by its pictures, weights applied.

    Attributes:
        total: Scalar with a gradient.
        box: Its box term, without gradient.
        objectness: Its objectness term, likewise.
        classes: Its class term, likewise.
        points: Its term of ground points, likewise; 0 where the heads have none.
    """

    total: Tensor
    box: Tensor
    objectness: Tensor
    classes: Tensor
    points: Tensor


@dataclass(frozen=True, slots=True)
class _Targets:
    """Which predictions of one head learn which truth; (P,) each, boxes (P, 4) xyxy, feet (P, 2) input px."""

    picture: Tensor
    anchor: Tensor
    row: Tensor
    column: Tensor
    boxes: Tensor
    class_id: Tensor
    feet: Tensor


def yolo_loss(heads: tuple[Tensor, ...], layers: tuple[Yolo, ...], batch: Batch, params: LossParams) -> LossTerms:
    """Compare raw heads with the truth.

    Args:
        heads: Of each head (B, anchors * values, h, w).
        layers: The heads' sections of the cfg, in the same order.
        batch: Its truth; boxes in input pixels.
        params: Weights and thresholds.
    """
    height_px, width_px = batch.pictures.shape[-2:]
    known = ~batch.ignored
    sizes_px = (batch.boxes[:, 2:] - batch.boxes[:, :2])[known]
    learns = _learning_anchors(sizes_px, layers, params.anchor_iou)
    zero = heads[0].new_zeros((), dtype=torch.float32)
    box, objectness, classes, points = zero, zero, zero, zero
    start = 0
    for raw, layer in zip(heads, layers, strict=True):
        count = len(layer.anchors_px)
        grid = _Grid.of(raw, layer, width_px, height_px)
        targets = _assign(batch, known, learns[:, start : start + count], grid)
        start += count
        wanted = torch.zeros_like(grid.objectness)
        wanted[targets.picture, targets.anchor, targets.row, targets.column] = 1.0
        counted = ~(_near_truth(grid, batch, params.ignore_iou) | _in_ignored(grid, batch)) | (wanted > 0)
        each = functional.binary_cross_entropy_with_logits(grid.objectness, wanted, reduction="none")
        objectness = objectness + (each * counted).sum()
        if len(targets.picture):
            box = box + _box_term(grid, targets, params.box, (width_px, height_px))
            classes = classes + _class_term(grid, targets)
            if layer.has_point:
                points = points + _point_term(grid, targets)
    pictures = len(batch.pictures)
    box, objectness, classes, points = (
        params.box_weight * box / pictures,
        params.objectness_weight * objectness / pictures,
        params.class_weight * classes / pictures,
        params.point_weight * points / pictures,
    )
    total = box + objectness + classes + points
    return LossTerms(total, box.detach(), objectness.detach(), classes.detach(), points.detach())


@dataclass(frozen=True, slots=True)
class _Grid:
    """One head's raw output in float32, and its boxes.

    Attributes:
        values: (B, A, h, w, values) raw.
        boxes: (B, A, h, w, 4) decoded, xyxy input px.
        layer: Its section of the cfg.
        cell_px: (2,) width and height of a cell.
        anchors_px: (A, 2).
    """

    values: Tensor
    boxes: Tensor
    layer: Yolo
    cell_px: Tensor
    anchors_px: Tensor

    @property
    def objectness(self) -> Tensor:
        return self.values[..., 4]

    @classmethod
    def of(cls, raw: Tensor, layer: Yolo, width_px: int, height_px: int) -> _Grid:
        pictures, _, height, width = raw.shape
        values = raw.float().reshape(pictures, len(layer.anchors_px), layer.values, height, width)
        values = values.permute(0, 1, 3, 4, 2)
        anchors_px = raw.new_tensor(layer.anchors_px, dtype=torch.float32)
        cell_px = raw.new_tensor([width_px / width, height_px / height], dtype=torch.float32)
        rows, columns = torch.meshgrid(
            torch.arange(height, device=raw.device), torch.arange(width, device=raw.device), indexing="ij"
        )
        corner = torch.stack([columns, rows], dim=-1).float() - (layer.scale_xy - 1.0) / 2.0
        centre = (values[..., 0:2].sigmoid() * layer.scale_xy + corner) * cell_px
        half = values[..., 2:4].clamp(max=_LARGEST_LOG_SCALE).exp() * anchors_px[:, None, None] / 2.0
        return cls(values, torch.cat([centre - half, centre + half], dim=-1), layer, cell_px, anchors_px)


def _learning_anchors(sizes_px: Tensor, layers: tuple[Yolo, ...], least_iou: float) -> Tensor:
    """Return (M, all anchors) True where a truth is learnt: its best anchor, and those nearly as good."""
    anchors_px = sizes_px.new_tensor([anchor for layer in layers for anchor in layer.anchors_px])
    common = torch.minimum(sizes_px[:, None], anchors_px[None]).prod(dim=2)
    iou = common / (sizes_px.prod(dim=1)[:, None] + anchors_px.prod(dim=1)[None] - common)
    learns = iou > least_iou
    if len(sizes_px):
        learns[torch.arange(len(sizes_px)), iou.argmax(dim=1)] = True
    return learns


def _assign(batch: Batch, known: Tensor, learns: Tensor, grid: _Grid) -> _Targets:
    truth, anchor = learns.nonzero(as_tuple=True)
    boxes = batch.boxes[known][truth]
    cell = ((boxes[:, :2] + boxes[:, 2:]) / 2.0 / grid.cell_px).long()
    height, width = grid.values.shape[2:4]
    return _Targets(
        picture=batch.picture[known][truth],
        anchor=anchor,
        row=cell[:, 1].clamp(0, height - 1),
        column=cell[:, 0].clamp(0, width - 1),
        boxes=boxes,
        class_id=batch.class_id[known][truth],
        feet=batch.feet[known][truth],
    )


def _near_truth(grid: _Grid, batch: Batch, iou: float) -> Tensor:
    """Return (B, A, h, w) True where a prediction overlaps any truth of its picture, known or ignored, by more."""
    near = torch.zeros_like(grid.objectness, dtype=torch.bool)
    with torch.no_grad():
        for picture in sorted(set(batch.picture.tolist())):
            truths = batch.boxes[batch.picture == picture]
            flat = grid.boxes[picture].reshape(-1, 4)
            near[picture] = (_pairwise_iou(flat, truths) > iou).any(dim=1).reshape(near.shape[1:])
    return near


def _in_ignored(grid: _Grid, batch: Batch) -> Tensor:
    """Return (B, A, h, w) True where the middle of a cell lies in a region of which nothing is known."""
    inside = torch.zeros_like(grid.objectness, dtype=torch.bool)
    height, width = inside.shape[2:]
    x_px = (torch.arange(width, device=inside.device) + 0.5) * grid.cell_px[0]
    y_px = (torch.arange(height, device=inside.device) + 0.5) * grid.cell_px[1]
    regions = zip(batch.picture[batch.ignored].tolist(), batch.boxes[batch.ignored], strict=True)
    for picture, (left, top, right, bottom) in regions:
        inside[picture] |= ((y_px >= top) & (y_px <= bottom))[:, None] & ((x_px >= left) & (x_px <= right))[None]
    return inside


def _box_term(grid: _Grid, targets: _Targets, kind: BoxLoss, size_px: tuple[int, int]) -> Tensor:
    at = targets.picture, targets.anchor, targets.row, targets.column
    if kind == "ciou":
        return (1.0 - complete_iou(grid.boxes[at], targets.boxes)).sum()
    values = grid.values[at]
    centre, size = (targets.boxes[:, :2] + targets.boxes[:, 2:]) / 2.0, targets.boxes[:, 2:] - targets.boxes[:, :2]
    scale_xy = grid.layer.scale_xy
    cell = torch.stack([targets.column, targets.row], dim=1).float()
    offset = values[:, 0:2].sigmoid() * scale_xy - (scale_xy - 1.0) / 2.0
    log_scale = (size / grid.anchors_px[targets.anchor]).clamp(min=1e-3).log()
    # Darknet's factor: an error of a pixel means more for a small box.
    importance = 2.0 - size.prod(dim=1) / (size_px[0] * size_px[1])
    errors = (offset - (centre / grid.cell_px - cell)).square() + (values[:, 2:4] - log_scale).square()
    return (importance * errors.sum(dim=1)).sum()


def _class_term(grid: _Grid, targets: _Targets) -> Tensor:
    classes = slice(5, 5 + grid.layer.classes)
    said = grid.values[targets.picture, targets.anchor, targets.row, targets.column, classes]
    wanted = functional.one_hot(targets.class_id, said.shape[1]).to(said.dtype)
    return functional.binary_cross_entropy_with_logits(said, wanted, reduction="sum")


def _point_term(grid: _Grid, targets: _Targets) -> Tensor:
    at = targets.picture, targets.anchor, targets.row, targets.column
    # What is wrong with the box is the box's to learn: the point learns to stand where it does in boxes as they are.
    boxes = grid.boxes[at].detach()
    centre_px, size_px = (boxes[:, :2] + boxes[:, 2:]) / 2.0, boxes[:, 2:] - boxes[:, :2]
    foot_px, log_sigma = points_of(grid.values[at][:, -POINT_VALUES:], centre_px, size_px)
    return point_loss((foot_px - targets.feet) / size_px, log_sigma - size_px.log())


def _pairwise_iou(first: Tensor, second: Tensor) -> Tensor:
    """Return (N, M) intersection over union of (N, 4) and (M, 4) boxes."""
    low = torch.maximum(first[:, None, :2], second[None, :, :2])
    high = torch.minimum(first[:, None, 2:], second[None, :, 2:])
    common = (high - low).clamp(min=0).prod(dim=2)
    areas = (first[:, 2:] - first[:, :2]).prod(dim=1), (second[:, 2:] - second[:, :2]).prod(dim=1)
    return common / (areas[0][:, None] + areas[1][None] - common).clamp(min=1e-9)


def complete_iou(first: Tensor, second: Tensor) -> Tensor:
    """Return (N,) complete IoU of boxes (N, 4) xyxy: overlap, less distance of centres, less difference of shape.

    >>> box = torch.tensor([[0.0, 0.0, 4.0, 2.0]])
    >>> complete_iou(box, box).item()
    1.0

    Source:
        Zheng et al., Distance-IoU Loss, 2020, eq. 10 and 11.
    """
    low, high = torch.maximum(first[:, :2], second[:, :2]), torch.minimum(first[:, 2:], second[:, 2:])
    common = (high - low).clamp(min=0).prod(dim=1)
    first_size, second_size = first[:, 2:] - first[:, :2], second[:, 2:] - second[:, :2]
    iou = common / (first_size.prod(dim=1) + second_size.prod(dim=1) - common).clamp(min=1e-9)
    around = torch.maximum(first[:, 2:], second[:, 2:]) - torch.minimum(first[:, :2], second[:, :2])
    between = (first[:, :2] + first[:, 2:] - second[:, :2] - second[:, 2:]) / 2.0
    distance = between.square().sum(dim=1) / around.square().sum(dim=1).clamp(min=1e-9)
    angles = [torch.atan2(size[:, 0], size[:, 1].clamp(min=1e-9)) for size in (first_size, second_size)]
    shape = 4.0 / math.pi**2 * (angles[0] - angles[1]).square()
    with torch.no_grad():
        importance = shape / (1.0 - iou + shape).clamp(min=1e-9)
    return iou - distance - importance * shape
