"""A static camera's ground map from points whose positions on the ground were measured."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np
import numpy.typing as npt

from standoff.core import homography, protocols
from standoff.core.camera import Camera, CameraPrior
from standoff.core.errors import GroundError
from standoff.core.geographic import GeographicOrigin
from standoff.core.homography import FloatArray
from standoff.core.types import CameraMotion, Detections, Frame, GroundMap, NoCameraMotion, NoGroundMap
from standoff.stages.ground.height_plane import NOT_LAID, HeightPlane, fit_heights, laid_on_plane
from standoff.stages.ground.survey_fit import SurveyFit, fit_survey

# Two normal coordinates reach it once in 50,000 points.
_SUSPICIOUS_SCORE = 3.3
_STEPS_PER_SIDE = 16


class SurveyedGround(protocols.Ground):
    """Give the same map for every frame of a camera that does not move.

    The map minimises the distances in the picture between the points, freed from lens distortion, and the
    pictures of their surveyed positions. `describe` tells the residuals of every point and warnings.

    A frame of another size than the survey's, but of the same shape (aspect ratio within one per cent), gets the
    map scaled to it; of another shape, `NoGroundMap("picture size differs from the survey")`, because nobody
    knows what was cut off.

    Args:
        points_px: (N, 2) points as seen in the picture, N >= 4; the centre of the top-left pixel is (0, 0).
        points_m: (N, 2) their positions, x east and y north or any other right-handed axes seen from above.
        image_size_px: (width, height) of the picture that the points were read from.
        heights_m: (N,) their heights, upwards from any level, NaN where none was measured: the ground is the plane
            through them. Empty: no height is known, and the points are taken to lie on one plane.
        names: N names for messages; left out: "point 1" and so on.
        camera: The lens, if its distortion is to be removed.
        area_px: (V, 2) polygon as seen in the picture outside which the map is not trusted, for example where
            the ground is not flat; empty: no limit but the horizon.
        point_sigma_px: How well a point was read, one coordinate; the survey's own error belongs in it too.
        time_s: When the picture was taken that the points were read from, where the camera does not stay as it was
            then; None: any time.
        origin: Where on the earth the positions are counted from; None: nobody said.

    Attributes:
        points_m: (N, 2) as given.
        plane: Through the heights; None: there are none.
        time_s: As given.
        origin: As given.
        fit: Residuals and covariance.

    Raises:
        GroundError: The points do not define a map.
    """

    def __init__(
        self,
        points_px: npt.ArrayLike,
        points_m: npt.ArrayLike,
        image_size_px: tuple[int, int],
        *,
        heights_m: npt.ArrayLike = (),
        names: Sequence[str] = (),
        camera: Camera | None = None,
        area_px: npt.ArrayLike = (),
        point_sigma_px: float = 1.0,
        time_s: float | None = None,
        origin: GeographicOrigin | None = None,
    ) -> None:
        seen_px, surveyed_m = _pairs(points_px, points_m)
        names = tuple(names) or tuple(f"point {number}" for number in range(1, len(seen_px) + 1))
        if len(names) != len(seen_px):
            found = f"{len(names)} names for {len(seen_px)} points"
            raise GroundError(expected="one name a point", found=found, fix="correct the names")
        if not (np.isfinite(point_sigma_px) and point_sigma_px > 0):
            fix = "give pixels, 1 for careful clicks"
            raise GroundError(expected="a positive point_sigma_px", found=f"{point_sigma_px}", fix=fix)
        _check_inside(seen_px, image_size_px, names)
        camera = None if camera is None else _fitting_camera(camera, image_size_px)
        ideal_px = _undistorted(seen_px, camera, names)
        self.points_m, self.time_s, self.origin = surveyed_m, time_s, origin
        self.plane = _plane(surveyed_m, heights_m, names)
        warnings: list[str] = []
        if self.plane is not None:
            prior = CameraPrior.unknown(*image_size_px) if camera is None else CameraPrior.calibrated(camera)
            ideal_px, laid = laid_on_plane(self.plane, seen_px, ideal_px, surveyed_m, prior)
            warnings = self.plane.warnings + ([] if laid else [NOT_LAID])
        self.fit = fit_survey(ideal_px, surveyed_m, names, point_sigma_px)
        self._surveyed = GroundMap(
            image_to_ground=self.fit.image_to_ground,
            covariance=self.fit.covariance,
            image_size_px=image_size_px,
            method="surveyed",
            scale_m_per_px=_scale_m_per_px(self.fit.image_to_ground, ideal_px),
            valid_px=_area(area_px, camera),
            anchors_px=seen_px,
            camera=camera,
            frame_stated=True,
            relief=None if self.plane is None else self.plane.relief,
        )
        self._current: GroundMap | NoGroundMap = self._surveyed
        self._current_size_px = image_size_px
        self._description = _describe(self.fit, self._surveyed, names, point_sigma_px)
        self._description["warnings"] += warnings
        if self.plane is not None:
            self._description["heights"] = self.plane.describe()
            self._description["basis"] += f"; {self.plane.text}"

    def describe(self) -> dict[str, Any]:
        """Return what the fit says of points and map, for the record."""
        return self._description

    @property
    def is_mirrored(self) -> bool:
        """Whether y of the metres lies to the right of x, seen from above."""
        return bool(np.linalg.det(self._surveyed.image_to_ground) > 0)

    @property
    def has_area(self) -> bool:
        """Whether there is a limit to where the map is trusted."""
        return len(self._surveyed.valid_px) > 0

    @property
    def camera(self) -> Camera | None:
        """The lens, for pictures of the survey's size."""
        return self._surveyed.camera

    def points_in(self, size_px: tuple[int, int]) -> tuple[FloatArray, float]:
        """Return (N, 2) the points as seen in pictures of a size (width, height), and their standard error there.

        Raises:
            GroundError: The picture has not the survey's shape.
        """
        return self._in(size_px).anchors_px, self.fit.sigma_px * size_px[0] / self._surveyed.image_size_px[0]

    def points_in_plane(self) -> FloatArray:
        """Return (N, 3) the points in the frame in which the ground is z = 0: the plane's, or else the site's."""
        if self.plane is None:
            return np.column_stack([self.points_m, np.zeros(len(self.points_m))])
        return self.plane.in_plane(self.points_m, self.plane.off_m)

    def prepare(self, size_px: tuple[int, int]) -> None:
        """Make sure that pictures of a size (width, height) have the survey's shape, before the first frame.

        Raises:
            GroundError: They do not.
        """
        self._in(size_px)

    def _in(self, size_px: tuple[int, int]) -> GroundMap:
        scaled = _scaled(self._surveyed, size_px)
        if isinstance(scaled, NoGroundMap):
            width, height = self._surveyed.image_size_px
            raise GroundError(
                expected=f"pictures of the survey's shape, {width}x{height}",
                found=f"{size_px[0]}x{size_px[1]}",
                fix="survey a frame of this source",
            )
        return scaled

    def update(
        self, frame: Frame, detections: Detections, motion: CameraMotion | NoCameraMotion
    ) -> GroundMap | NoGroundMap:
        """Return the map for a frame; detections and motion play no part.

        Returns:
            The same object as long as the frame's size is the same.
        """
        if frame.size_px != self._current_size_px:
            self._current_size_px = frame.size_px
            self._current = _scaled(self._surveyed, frame.size_px)
        return self._current


def _pairs(points_px: npt.ArrayLike, points_m: npt.ArrayLike) -> tuple[FloatArray, FloatArray]:
    expected = "four or more points, each with px and m"
    try:
        seen_px, surveyed_m = np.array(points_px, dtype=np.float64), np.array(points_m, dtype=np.float64)
    except (TypeError, ValueError):
        raise GroundError(expected=expected, found="something else", fix="correct the points") from None
    for name, points in (("points_px", seen_px), ("points_m", surveyed_m)):
        if points.size and (points.ndim != 2 or points.shape[1] != 2):
            raise GroundError(expected=f"{name} of shape (N, 2)", found=f"{points.shape}", fix="correct the points")
        if not np.isfinite(points).all():
            raise GroundError(expected=f"finite {name}", found="NaN or infinity", fix="correct the points")
    if len(seen_px) != len(surveyed_m):
        found = f"{len(seen_px)} px and {len(surveyed_m)} m"
        raise GroundError(expected=expected, found=found, fix="complete the points")
    if len(seen_px) < 4:
        raise GroundError(expected=expected, found=f"{len(seen_px)}", fix="survey more points")
    return seen_px, surveyed_m


def _plane(points_m: FloatArray, heights_m: npt.ArrayLike, names: Sequence[str]) -> HeightPlane | None:
    heights = np.array(heights_m, dtype=np.float64)
    if heights.size and heights.shape != (len(points_m),):
        found = f"an array of shape {heights.shape} for {len(points_m)} points"
        raise GroundError(expected="one height (z_m) a point, NaN for none", found=found, fix="correct the heights")
    return None if np.isnan(heights).all() else fit_heights(points_m, heights, names)


def _check_inside(points_px: FloatArray, image_size_px: tuple[int, int], names: Sequence[str]) -> None:
    outside = ((points_px < -0.5) | (points_px > np.array(image_size_px) - 0.5)).any(axis=1)
    if outside.any():
        first = int(np.argmax(outside))
        raise GroundError(
            expected=f"points inside the {image_size_px[0]}x{image_size_px[1]} picture",
            found=f"{names[first]!r} at {points_px[first, 0]:g}, {points_px[first, 1]:g}",
            fix="give the size of the picture that the points were read from",
        )


def _fitting_camera(camera: Camera, image_size_px: tuple[int, int]) -> Camera:
    try:
        return camera.scaled_to(*image_size_px)
    except ValueError as error:
        fix = "calibrate with pictures of the same shape"
        raise GroundError(expected="a camera for the survey's picture", found=str(error), fix=fix) from None


def _undistorted(points_px: FloatArray, camera: Camera | None, names: Sequence[str]) -> FloatArray:
    ideal_px = points_px if camera is None else camera.undistort(points_px)
    lost = np.isnan(ideal_px).any(axis=1)
    if lost.any():
        raise GroundError(
            expected="points that the camera's lens can see",
            found=f"{names[int(np.argmax(lost))]!r} where its distortion has no inverse",
            fix="check the camera file",
        )
    return ideal_px


def _area(area_px: npt.ArrayLike, camera: Camera | None) -> FloatArray:
    corners_px = np.array(area_px, dtype=np.float64)
    if not corners_px.size:
        return np.zeros((0, 2))
    if corners_px.ndim != 2 or corners_px.shape[1] != 2 or len(corners_px) < 3 or not np.isfinite(corners_px).all():
        found = f"an array of shape {corners_px.shape}"
        raise GroundError(expected="area_px: three or more finite points", found=found, fix="correct the area")
    if camera is None:
        return corners_px
    # A side that is straight in the picture is bent once the distortion is gone.
    share = np.arange(_STEPS_PER_SIDE)[:, None] / _STEPS_PER_SIDE
    steps = corners_px[:, None] + share * (np.roll(corners_px, -1, axis=0) - corners_px)[:, None]
    outline_px = steps.reshape(-1, 2)
    return _undistorted(outline_px, camera, ["a point of area_px"] * len(outline_px))


def _scale_m_per_px(image_to_ground: FloatArray, points_px: FloatArray) -> float:
    """Metres per undistorted pixel at the centroid of the points: the root of the local change of area."""
    jacobian = homography.point_jacobian(image_to_ground, points_px.mean(axis=0)[None])[0]
    return float(np.sqrt(abs(np.linalg.det(jacobian))))


def _scaled(surveyed: GroundMap, size_px: tuple[int, int]) -> GroundMap | NoGroundMap:
    """Return the map for pictures of another size; edges of the picture, not pixel centres, stay in place."""
    if size_px == surveyed.image_size_px:
        return surveyed
    scale = np.array(size_px) / np.array(surveyed.image_size_px)
    if abs(scale[0] / scale[1] - 1.0) > 0.01:
        return NoGroundMap("picture size differs from the survey")
    shift = (scale - 1.0) / 2.0
    to_surveyed = np.linalg.inv(np.array([[scale[0], 0.0, shift[0]], [0.0, scale[1], shift[1]], [0.0, 0.0, 1.0]]))
    by_entries = np.eye(len(surveyed.covariance))
    by_entries[:9, :9] = np.kron(np.eye(3), to_surveyed.T)
    return replace(
        surveyed,
        image_to_ground=surveyed.image_to_ground @ to_surveyed,
        covariance=by_entries @ surveyed.covariance @ by_entries.T,
        image_size_px=size_px,
        scale_m_per_px=surveyed.scale_m_per_px / float(np.sqrt(scale[0] * scale[1])),
        valid_px=surveyed.valid_px * scale + shift,
        anchors_px=surveyed.anchors_px * scale + shift,
        camera=None if surveyed.camera is None else surveyed.camera.scaled_to(*size_px),
    )


def _describe(fit: SurveyFit, surveyed: GroundMap, names: Sequence[str], point_sigma_px: float) -> dict[str, Any]:
    length_px, length_m = np.linalg.norm(fit.residuals_px, axis=1), np.linalg.norm(fit.residuals_m, axis=1)
    warnings = []
    worst = int(np.argmax(fit.outlier_score))
    if fit.outlier_score[worst] > _SUSPICIOUS_SCORE:
        warnings.append(
            f"the points disagree by {length_px.max():.1f} px, more than reading them to {point_sigma_px:g} px "
            f"allows; most likely wrong: {names[worst]!r}"
        )
    if np.linalg.det(surveyed.image_to_ground) > 0:
        warnings.append("the metres are mirrored: seen from above, y must lie to the left of x")
    return {
        "method": "surveyed",
        "basis": f"{len(names)} surveyed points, {length_m.max():.2g} m off at the most",
        "better": "more points, spread over the whole picture, make it better",
        "image_size_px": list(surveyed.image_size_px),
        "lens_distortion_removed": surveyed.camera is not None,
        "rms_px": float(np.sqrt((length_px**2).mean())),
        "rms_m": float(np.sqrt((length_m**2).mean())),
        "sigma_px": fit.sigma_px,
        "scale_m_per_px": surveyed.scale_m_per_px,
        "points": [
            {
                "name": name,
                "px": surveyed.anchors_px[i].tolist(),
                "residual_px": float(length_px[i]),
                "residual_m": float(length_m[i]),
            }
            for i, name in enumerate(names)
        ],
        "warnings": warnings,
    }
