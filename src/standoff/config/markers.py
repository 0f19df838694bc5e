"""Settings of printed markers: which ones there are, and where they lie."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Annotated

import numpy as np
from pydantic import BaseModel, ConfigDict, Field, model_validator

from standoff.core.errors import GroundError
from standoff.stages.ground import MarkerPlace

Point3 = tuple[float, float, float]


class MarkerSettings(BaseModel):
    """One printed marker: its size, and its place unless it defines the site frame itself."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: Annotated[int, Field(ge=0, description="Within its family.")] = 0
    size_m: Annotated[float, Field(gt=0, description="Side of the black square, outer edge to outer edge; m.")]
    corners_m: Annotated[
        tuple[Point3, Point3, Point3, Point3] | None,
        Field(description="Outer corners of the black square, 0 to 3 as printed, x y z in the site frame; m."),
    ] = None
    x_m: Annotated[float | None, Field(description="Of corner 0, site frame; m. Goes with y_m.")] = None
    y_m: Annotated[float | None, Field(description="Of corner 0, site frame; m.")] = None
    heading_deg: Annotated[
        float | None,
        Field(description="From corner 0 to corner 1, counter-clockwise from the site's x axis. Absent: 0."),
    ] = None
    height_m: Annotated[
        float | None, Field(description="Of its plane above the ground; m. Absent: 0. Not with corners_m.")
    ] = None

    @model_validator(mode="after")
    def _one_place(self) -> MarkerSettings:
        if (self.x_m is None) != (self.y_m is None):
            raise ValueError("x_m and y_m go together")
        if self.heading_deg is not None and self.x_m is None:
            raise ValueError("heading_deg needs x_m and y_m")
        if self.corners_m is not None and (self.x_m is not None or self.height_m is not None):
            raise ValueError("give either corners_m or x_m, y_m, heading_deg and height_m, not both")
        try:
            place = self.place()
        except GroundError as error:
            raise ValueError(f"expected {error.expected}, found {error.found}") from error
        if abs(place.size_m / self.size_m - 1.0) > 0.02:
            raise ValueError(f"corners_m are those of a square of {place.size_m:.3f} m, size_m is {self.size_m:g}")
        return self

    @property
    def is_placed(self) -> bool:
        """Whether the site frame is somebody else's and this marker's place in it is given."""
        return self.corners_m is not None or self.x_m is not None

    def place(self) -> MarkerPlace:
        """Return where it lies; without a place it defines the site frame, as a square reference does."""
        if self.corners_m is not None:
            return MarkerPlace(self.id, np.array(self.corners_m))
        xy_m = (self.x_m or 0.0, self.y_m or 0.0)
        heading_deg, height_m = self.heading_deg or 0.0, self.height_m or 0.0
        return MarkerPlace.lying(self.id, self.size_m, xy_m=xy_m, heading_deg=heading_deg, height_m=height_m)


def check_markers(markers: Sequence[MarkerSettings], other: str | None) -> None:
    """Raise ValueError where two things would define the site frame, or one marker had two places.

    Args:
        markers: All of a site.
        other: What else defines the site frame: "survey", "reference", or None.
    """
    ids = [marker.id for marker in markers]
    if len(set(ids)) < len(ids):
        raise ValueError("each id in markers must be there once only")
    loose = [marker for marker in markers if not marker.is_placed]
    if loose and (other is not None or len(markers) > 1):
        beside = other if other is not None else "other markers"
        raise ValueError(f"marker {loose[0].id} beside {beside} needs a place: corners_m, or x_m and y_m")
