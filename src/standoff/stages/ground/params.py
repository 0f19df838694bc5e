"""Settings of the ground map from a reference object."""

from dataclasses import dataclass
from typing import Annotated, Literal

from annotated_types import Ge, Gt, Interval
from typing_extensions import Doc

ReferenceMethod = Literal["paper", "paper+tls", "oriented", "refined", "fused"]


@dataclass(frozen=True, slots=True)
class ReferenceParams:
    """How the reference object is looked for, and when an answer is not believed."""

    method: Annotated[
        ReferenceMethod,
        Doc(
            "fused: the reference as a solid, seen by a camera that is followed from frame to frame. refined: the same "
            "for each frame alone. paper: the paper's steps exactly, each frame alone. paper+tls: its four lines "
            "refitted by total least squares. oriented: edge directions, candidate lines and sub-pixel refit."
        ),
    ] = "fused"
    high_threshold: Annotated[
        float, Interval(gt=0, le=1), Doc("Canny's upper threshold, a share of the box's largest gradient (paper: 0.6).")
    ] = 0.6
    low_threshold: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("Canny's lower threshold, another such share (paper: 0.24)."),
    ] = 0.24
    iterations: Annotated[int, Interval(ge=1, le=100_000), Doc("RANSAC hypotheses a contour (paper: 2000).")] = 2000
    inlier_px: Annotated[
        float, Interval(gt=0, le=10), Doc("Distance in px within which an edge point supports a contour (paper: 1).")
    ] = 1.0
    seed: Annotated[int, Ge(0), Doc("Of RANSAC's hypotheses; the same frame always gives the same answer.")] = 0
    min_score: Annotated[
        float, Interval(ge=0, le=1), Doc("Detections of the reference less sure than this are ignored.")
    ] = 0.3
    box_margin: Annotated[
        float | None,
        Interval(ge=0, le=1),
        Doc(
            "The search goes this share of the box's longer side beyond the box, because detectors cut corners. "
            "None: 0.06 for `oriented`; the others stay inside the box, as the paper does."
        ),
    ] = None
    min_side_support: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc("Each side needs edge points along at least this share of its length; less is taken as a chance line."),
    ] = 0.35
    corner_sigma_px: Annotated[
        float, Gt(0), Doc("Standard error of a corner coordinate in px for `paper`, which cannot tell; measured.")
    ] = 0.4
    plausible_px: Annotated[
        float,
        Gt(0),
        Doc("A real camera must be able to see the shape with its corners moved by no more than this many px."),
    ] = 2.0
    plausible_share: Annotated[
        float, Interval(ge=0, le=1), Doc("The same as a share of the mean side in px, for errors of the tape measure.")
    ] = 0.03
    focal_widths: Annotated[
        tuple[float, float],
        Doc("Shortest and longest focal length, in picture widths, of an unknown camera (wide 0.4, tele 6)."),
    ] = (0.4, 6.0)
    memory_s: Annotated[
        float, Gt(0), Doc("For so many seconds the last known outline tells which corner is which, and where to look.")
    ] = 2.0

    size_sigma: Annotated[
        float, Interval(ge=0, le=0.2), Doc("Standard error of the reference's stated lengths, as a share of them.")
    ] = 0.005
    max_scale_sigma: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("A map whose scale is less sure than this share (one standard error) is no map."),
    ] = 0.1

    def __post_init__(self) -> None:
        if self.low_threshold > self.high_threshold:
            raise ValueError(
                f"low_threshold ({self.low_threshold:g}) must not be above high_threshold ({self.high_threshold:g})"
            )
        shortest, longest = self.focal_widths
        if not 0 < shortest < longest:
            raise ValueError(f"focal_widths must be two rising numbers above 0, not {shortest:g} and {longest:g}")


@dataclass(frozen=True, slots=True)
class FusedParams:
    """What the ground may be measured by beside references and markers, and when a map is none."""

    telemetry: Annotated[
        bool, Doc("Whether the drone's telemetry counts: beside references and markers, and alone where there is none.")
    ] = True
    sizes: Annotated[bool, Doc("Whether known sizes of people alone may give a map.")] = True
    size_sigma: Annotated[
        float, Interval(ge=0, le=0.2), Doc("Standard error of a printed marker's stated size, as a share of it.")
    ] = 0.005
    max_scale_sigma: Annotated[
        float,
        Interval(gt=0, le=1),
        Doc("A map whose lengths are less sure than this share is no map; for references their own limit."),
    ] = 0.3
