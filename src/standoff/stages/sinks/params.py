"""Settings of the sinks."""

from dataclasses import dataclass
from typing import Annotated

from annotated_types import Gt, Interval
from typing_extensions import Doc

from standoff.core.lengths import UnitName


@dataclass(frozen=True, slots=True)
class TableParams:
    """How often the tables reach the disk while a run goes on."""

    flush_s: Annotated[
        float, Gt(0), Doc("Seconds of wall time between parts; a killed run loses at most these. 5 keeps parts few.")
    ] = 5.0
    flush_rows: Annotated[int, Gt(0), Doc("Rows after which a part is written sooner, which bounds the memory.")] = (
        50_000
    )


@dataclass(frozen=True, slots=True)
class ShowParams:
    """How the film and the report show lengths and people."""

    unit: Annotated[
        UnitName,
        Doc("What people read lengths in: metres or feet. Tables, hazards.jsonl and run.json are always in metres."),
    ] = "metres"
    blur: Annotated[
        bool, Doc("Make people unrecognisable in film and report; whom the detector misses stays recognisable.")
    ] = False


@dataclass(frozen=True, slots=True)
class DrawParams:
    """What is drawn into the picture and the rectified panel."""

    line_within_m: Annotated[
        float, Gt(0), Doc("Distance lines are drawn for each person's nearest pair up to this; m. Hazards always.")
    ] = 25.0
    size: Annotated[float, Interval(ge=0.3, le=4), Doc("Factor on the usual size of text and lines.")] = 1.0
    circles: Annotated[bool, Doc("Draw the action radii, as the ellipses that they are in the picture.")] = True
    fans: Annotated[bool, Doc("Draw where moving entities are likely to be within two seconds.")] = True
    unwatched: Annotated[bool, Doc("Hatch the ground on which a worker would not be found.")] = True
    labels: Annotated[bool, Doc("Draw class names, ids, distances and the names of zones.")] = True
    legend: Annotated[bool, Doc("Draw what the colours mean.")] = True


@dataclass(frozen=True, slots=True)
class VideoParams:
    """The annotated video."""

    max_width_px: Annotated[
        int,
        Interval(ge=320, le=7680),
        Doc("Width of the video, panel included; px. Larger sources are scaled down: drawing costs by the pixel."),
    ] = 1600
    panel: Annotated[bool, Doc("Show the rectified picture (Eq. 5) with a scale bar beside the camera's.")] = True
    panel_aspect: Annotated[float, Interval(ge=0.3, le=2.0), Doc("Width of the panel over its height.")] = 0.6
    crf: Annotated[
        int, Interval(ge=0, le=51), Doc("x264's constant rate factor: 18 looks like the source, 28 is small.")
    ] = 23
    preset: Annotated[str, Doc("x264's preset; slower ones make smaller files. superfast keeps up on two cores.")] = (
        "superfast"
    )
    draw: Annotated[DrawParams, Doc("What is drawn.")] = DrawParams()


@dataclass(frozen=True, slots=True)
class ReportParams:
    """How much the report shows."""

    moments: Annotated[int, Interval(ge=0, le=24), Doc("Number of worst moments shown with their pictures.")] = 6
    pairs: Annotated[int, Interval(ge=1, le=500), Doc("Number of pairs whose curves are kept, the closest ones.")] = 50
    moment_width_px: Annotated[int, Interval(ge=320, le=1920), Doc("Width of those pictures; px.")] = 960
