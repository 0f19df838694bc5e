"""Every tolerance that the tests use, and why it is what it is.

Never loosen one to get green: find out why it fails first.
"""

from __future__ import annotations

GEOMETRY_REL = 1e-9
"""Closed-form geometry in float64: some hundred roundings, well-conditioned points."""

DISTORTION_PX = 1e-6
"""Against OpenCV's undistortPoints, which iterates to its own epsilon."""

GROUND_THROUGH_LENS_M = 1e-6
"""OpenCV projects, we undistort: DISTORTION_PX times some 0.1 m a pixel on ground 60 m away, and some to spare."""

DARKNET_DECODED = 1e-3
"""Against OpenCV's Darknet importer, fractions of the input and probabilities: the issue's bound, float32 in 75 layers."""

NUMERICAL_DERIVATIVE_REL = 1e-5
"""Two central differences of the lens model with steps of 0.5 and 0.001 px: the third derivative and the rounding."""

ITERATED_INVERSE_PX = 1e-4
"""OpenCV's undistortPoints at the edge of the picture, stopped by its own 1e-8 in normalised units or 100 steps."""

FIRST_ORDER_SIGMA_REL = 0.12
"""A first-order standard error against 2000 random trials: 1.6 % is sampling, the rest the map's curvature."""
