"""Does the standard error of a distance say how far off distances really are?"""

from __future__ import annotations

import numpy as np
import pytest
from stages.locate.oblique_world import MATRIX, SIZE_PX, seen_px, standing, tracks_of

from standoff.core import homography
from standoff.core.camera import Camera
from standoff.core.homography import FloatArray
from standoff.core.types import GroundMap
from standoff.stages.locate import LocateParams, Locator
from standoff.stages.proximity import ProximityMeter, ProximityParams

ANCHORS_M = np.array([[-6.0, 30.0], [6.0, 30.0], [6.0, 42.0], [-6.0, 42.0]])
PLACES_M = np.array([[-9.0, 33.0], [8.0, 47.0], [2.0, 36.0]])
ANCHOR_SIGMA_PX = 1.0
LENS = np.array([-0.12, 0.03, 0.001, -0.0008, 0.0])
TRIALS = 600
"""Three pairs share a trial's map, so the effective number of draws lies between this and three times it."""


def measured_map(rng: np.random.Generator, lens: FloatArray | None) -> GroundMap:
    """Return a map fitted to four anchors seen with an error, with the covariance that it claims."""
    camera = None if lens is None else Camera(*SIZE_PX, MATRIX, lens)
    noise_px = ANCHOR_SIGMA_PX * rng.normal(size=(4, 2))
    # The covariance of the fit knows undistorted pixels only, so that is where the anchors' error is drawn.
    undistorted = seen_px(ANCHORS_M) + noise_px
    matrix = homography.fit(undistorted, ANCHORS_M)
    covariance = homography.fit_covariance(matrix, undistorted, np.tile(np.eye(2) * ANCHOR_SIGMA_PX**2, (4, 1, 1)))
    return GroundMap(matrix, covariance, SIZE_PX, "four anchors", 0.02, camera=camera)


@pytest.mark.parametrize(
    "lens", [pytest.param(None, marks=pytest.mark.live, id="pinhole"), pytest.param(LENS, id="lens")]
)
def test_two_thirds_of_all_distances_lie_within_one_sigma_of_the_truth(lens: FloatArray | None) -> None:
    rng = np.random.default_rng(1)
    boxes = standing(seen_px(PLACES_M, lens), width_px=30.0, height_px=50.0)
    edge_sigma_px = 0.06 * np.array([30.0, 50.0, 30.0, 50.0])
    params = ProximityParams(pairs=(("person", "person"),))
    ratios = []
    for _ in range(TRIALS):
        ground = measured_map(rng, lens)
        tracks = tracks_of(boxes + rng.normal(size=boxes.shape) * edge_sigma_px)
        positions = Locator(LocateParams("bottom_centre", edge_sigma_fraction=0.06, relief_sigma_m=0.0)).update(
            0.0, tracks, ground
        )
        found = ProximityMeter(params).update(0.0, positions, ground)
        a, b = found.track_a - 1, found.track_b - 1
        truth_m = np.linalg.norm(PLACES_M[a] - PLACES_M[b], axis=1)
        ratios.append((found.distance_m - truth_m) / found.sigma_m)
    share = np.mean(np.abs(ratios) < 1.0)
    four_sigmas_of_a_binomial = 4.0 * np.sqrt(0.683 * 0.317 / TRIALS)
    assert abs(share - 0.683) < four_sigmas_of_a_binomial
