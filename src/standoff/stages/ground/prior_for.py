"""What is known of the camera, for pictures of the size that came."""

from __future__ import annotations

from standoff.core.camera import CameraPrior
from standoff.core.errors import GroundError


def prior_for(given: CameraPrior | None, size_px: tuple[int, int]) -> CameraPrior:
    """Return what is known of the camera for pictures of a size (width, height); None given: a drone's usual lens.

    Raises:
        GroundError: The camera is known for pictures of another shape.
    """
    try:
        return CameraPrior.unknown(*size_px) if given is None else given.scaled_to(*size_px)
    except ValueError as error:
        raise GroundError(
            expected="pictures of the shape that the camera was calibrated for",
            found=str(error),
            fix="calibrate with pictures from the same camera mode as the video",
        ) from error
