from __future__ import annotations

from itertools import combinations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.cluster.vq import kmeans2

from standoff.core.errors import DataError
from standoff.core.homography import FloatArray
from standoff.training.start.anchors import cluster_anchors, mean_best_iou, overlap_of_sizes, spread_over_heads


def _blobs(rng: np.random.Generator, centres_px: FloatArray, spread: float) -> FloatArray:
    sizes_px: FloatArray = np.repeat(centres_px, 60, axis=0) * rng.normal(1.0, spread, (60 * len(centres_px), 2))
    return sizes_px


@pytest.mark.parametrize("seed", range(5))
def test_blobs_that_lie_apart_are_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    centres_px = np.array([[4.0, 9.0], [12.0, 30.0], [40.0, 20.0], [70.0, 80.0], [200.0, 90.0]])
    anchors_px = cluster_anchors(_blobs(rng, centres_px, 0.03), 5, rng)
    np.testing.assert_allclose(anchors_px, centres_px, rtol=0.02)


@pytest.mark.parametrize("seed", range(5))
def test_of_few_boxes_nearly_the_best_choice_is_found(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes_px = rng.uniform(4.0, 60.0, (12, 2))
    best_of_the_boxes = max(mean_best_iou(sizes_px, sizes_px[list(chosen)]) for chosen in combinations(range(12), 3))
    # A centre may lie between boxes, and the best starts may be missed: neither is worth more than this.
    assert mean_best_iou(sizes_px, cluster_anchors(sizes_px, 3, rng)) > best_of_the_boxes - 0.03


@pytest.mark.parametrize("seed", range(5))
def test_anchors_overlap_boxes_more_than_scipys_euclidean_clusters(seed: int) -> None:
    rng = np.random.default_rng(seed)
    sizes_px = np.exp(rng.normal([2.5, 3.2], [0.7, 0.6], (2000, 2)))
    euclidean_px, _ = kmeans2(sizes_px, 9, minit="++", rng=seed)
    assert mean_best_iou(sizes_px, cluster_anchors(sizes_px, 9, rng)) > mean_best_iou(
        sizes_px, euclidean_px.astype(np.float64)
    )


@given(
    sizes_px=st.lists(st.tuples(st.integers(1, 40), st.integers(1, 40)), min_size=1, max_size=30),
    count=st.integers(1, 9),
)
def test_anchors_are_always_as_many_as_wanted_sorted_positive_and_different(
    sizes_px: list[tuple[int, int]], count: int
) -> None:
    anchors_px = cluster_anchors(np.array(sizes_px, dtype=np.float64), count, np.random.default_rng(0))
    assert anchors_px.shape == (count, 2)
    assert np.isfinite(anchors_px).all()
    assert (anchors_px > 0).all()
    assert (np.diff(anchors_px.prod(axis=1)) >= 0).all()
    if len(set(sizes_px)) == 1:
        assert len(np.unique(anchors_px, axis=0)) == count


def test_the_same_seed_gives_the_same_anchors_of_more_boxes_than_are_looked_at() -> None:
    sizes_px = np.random.default_rng(0).uniform(4.0, 60.0, (6000, 2))
    once, again = (cluster_anchors(sizes_px, 6, np.random.default_rng(3)) for _ in range(2))
    assert np.array_equal(once, again)


def test_no_box_and_a_flat_box_are_refused() -> None:
    with pytest.raises(DataError, match="found none"):
        cluster_anchors(np.empty((0, 2)), 3, np.random.default_rng(0))
    with pytest.raises(DataError, match="found a side of 0 px"):
        cluster_anchors(np.array([[3.0, 0.0]]), 3, np.random.default_rng(0))


def test_overlap_is_one_for_the_same_size_and_the_area_ratio_for_one_inside_another() -> None:
    sizes_px = np.array([[4.0, 6.0], [2.0, 3.0]])
    np.testing.assert_allclose(overlap_of_sizes(sizes_px, sizes_px), [[1.0, 0.25], [0.25, 1.0]])


def test_larger_anchors_go_to_coarser_heads() -> None:
    heads = spread_over_heads(np.array([[n, n + 0.04] for n in range(1, 9)]), 3)
    assert [len(head) for head in heads] == [3, 3, 2]
    assert heads[0][0] == (1.0, 1.0)
    assert heads[2] == ((7.0, 7.0), (8.0, 8.0))
