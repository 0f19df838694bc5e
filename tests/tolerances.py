"""Every tolerance that the tests use, and why it is what it is.

Never loosen one to get green: find out why it fails first.
"""

from __future__ import annotations

GEOMETRY_REL = 1e-9
"""Closed-form geometry in float64: some hundred roundings, well-conditioned points."""

DISTORTION_PX = 1e-6
"""Against OpenCV's undistortPoints, which iterates to its own epsilon."""
