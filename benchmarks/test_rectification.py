"""Edges, lines and corners of one reference, by each method; the paper's RANSAC beside a literal Python loop."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import pytest

from standoff.evaluation.drawn_quadrilaterals import draw_quadrilateral
from standoff.evaluation.rectification import METHODS, paper_edges, ransac_by_loop
from standoff.stages.ground import OutlineFinder, ReferenceMethod, ReferenceParams, ransac_contours, sample_pairs

SCENE = draw_quadrilateral("sand", 0)


@pytest.mark.benchmark(group="outline")
@pytest.mark.parametrize("method", METHODS)
def test_outline(benchmark: Callable[..., Any], method: ReferenceMethod) -> None:
    finder = OutlineFinder(ReferenceParams(method=method))
    finder.find(SCENE.gray, SCENE.box_xyxy_px)
    assert benchmark(finder.find, SCENE.gray, SCENE.box_xyxy_px)


@pytest.mark.benchmark(group="ransac")
@pytest.mark.parametrize("ransac", [ransac_contours, ransac_by_loop])
def test_ransac(benchmark: Callable[..., Any], ransac: Callable[..., Any]) -> None:
    points, pairs = paper_edges(SCENE).points_px, sample_pairs(2000, 0)
    ransac(points, pairs, 1.0)
    assert benchmark(ransac, points, pairs, 1.0) is not None
