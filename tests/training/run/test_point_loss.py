from __future__ import annotations

import math
from dataclasses import replace

import pytest
import torch
from torch import Tensor
from training.run.test_loss import HEADS, STRICT, _batch, _raw, _some_truth

from standoff.training.darknet.layers import POINT_VALUES, Yolo
from standoff.training.darknet.network import LOG_SIGMA
from standoff.training.pictures.batches import Batch
from standoff.training.run.loss import yolo_loss
from standoff.training.run.point_loss import point_loss

POINTED = tuple(replace(head, has_point=True) for head in HEADS)


def _minimum(residual: Tensor, learns_mean: bool) -> tuple[float, float]:
    """Return shift and logarithm of the error at which the loss of many residuals is least, by descent."""
    shift, log_sigma = torch.zeros(2, requires_grad=True), torch.zeros(2, requires_grad=True)
    descent = torch.optim.Adam([shift, log_sigma] if learns_mean else [log_sigma], lr=0.08)
    for _ in range(250):
        descent.zero_grad()
        loss = point_loss(residual + shift, log_sigma.expand(len(residual), 2)) / len(residual)
        torch.autograd.backward(loss)
        descent.step()
    return shift.detach().mean().item(), log_sigma.detach().mean().item()


@pytest.mark.parametrize(("seed", "sigma"), [(0, 0.02), (1, 0.3), (2, 2.0)])
def test_the_least_loss_is_at_the_truth_with_the_residuals_own_spread(seed: int, sigma: float) -> None:
    generator = torch.Generator().manual_seed(seed)
    residual = sigma * torch.randn(1500, 2, generator=generator) + 0.4 * sigma
    shift, log_sigma = _minimum(residual, learns_mean=True)
    assert shift == pytest.approx(-0.4 * sigma, abs=0.1 * sigma)
    assert log_sigma == pytest.approx(math.log(sigma), abs=0.08)


def test_a_few_residuals_from_nowhere_hardly_move_the_stated_error() -> None:
    residual = 0.1 * torch.randn(1500, 2, generator=torch.Generator().manual_seed(0))
    residual[:15] = 30.0
    _, log_sigma = _minimum(residual, learns_mean=False)
    assert log_sigma < math.log(0.2), "the Gaussian likelihood alone would state 3"


@pytest.mark.parametrize("seed", range(3))
def test_what_nobody_marked_has_no_gradient_and_the_loss_is_never_negative(seed: int) -> None:
    generator = torch.Generator().manual_seed(seed)
    residual = torch.randn(50, 2, generator=generator)
    residual[::2] = torch.nan
    log_sigma = torch.empty(50, 2).uniform_(*LOG_SIGMA, generator=generator).requires_grad_()
    raw = residual.clone().requires_grad_()
    loss = point_loss(raw, log_sigma)
    torch.autograd.backward(loss)
    assert loss >= 0.0
    for gradient in (raw.grad, log_sigma.grad):
        assert gradient is not None and torch.isfinite(gradient[1::2]).all()
        assert not gradient[::2].nan_to_num(nan=1.0).any()


def _pointed(seed: int) -> tuple[tuple[Tensor, ...], tuple[Tensor, ...]]:
    """Return raw heads without points, and the same with."""
    plain = tuple(head.detach() for head in _raw(seed))
    values = HEADS[0].values
    with_points = []
    for head in plain:
        batch, _, height, width = head.shape
        by_anchor = head.reshape(batch, 2, values, height, width)
        extra = torch.zeros(batch, 2, POINT_VALUES, height, width)
        with_points.append(torch.cat([by_anchor, extra], dim=2).reshape(batch, -1, height, width).requires_grad_())
    return plain, tuple(with_points)


@pytest.mark.parametrize("seed", range(3))
def test_labels_without_points_train_the_rest_as_if_the_heads_had_none(seed: int) -> None:
    plain, pointed = _pointed(seed)
    batch = _some_truth(seed)
    expected, found = yolo_loss(plain, HEADS, batch, STRICT), yolo_loss(pointed, POINTED, batch, STRICT)
    torch.testing.assert_close(found.total, expected.total)
    assert found.points == 0.0
    torch.autograd.backward(found.total)
    for head in pointed:
        assert head.grad is not None
        raw = head.grad.reshape(len(head), 2, POINTED[0].values, *head.shape[2:])
        assert not raw[:, :, -POINT_VALUES:].any()


@pytest.mark.parametrize("head", [POINTED[0], pytest.param(POINTED[1], marks=pytest.mark.live)])
def test_descent_on_the_loss_brings_the_point_to_its_foot(head: Yolo) -> None:
    """The raw values alone that belong to the box learn where its foot is, outside the box too."""
    width, height = head.anchors_px[0]
    box = [50.0 - width / 2, 30.0 - height / 2, 50.0 + width / 2, 30.0 + height / 2]
    batch: Batch = replace(_batch([box], [1], [0], [False]), feet=torch.tensor([[44.0, 61.0]]))
    raws = _pointed(0)[1]
    params = replace(STRICT, point_weight=5.0)
    first = yolo_loss(raws, POINTED, batch, params).points.item()
    for rate in (0.1, 0.03, 0.01):  # small steps at the end, since the point moves with its box
        descent = torch.optim.Adam(raws, lr=rate)
        for _ in range(150):
            descent.zero_grad()
            torch.autograd.backward(yolo_loss(raws, POINTED, batch, params).total)
            descent.step()
    # What is left is the doubt that may be stated at the least.
    assert yolo_loss(raws, POINTED, batch, params).points.item() < 0.1 * first
