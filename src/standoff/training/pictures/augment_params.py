"""Settings of the augmentation: how drone pictures differ from those at hand."""

import math
from dataclasses import dataclass, fields, replace
from typing import Annotated, Final, Self, get_args

from annotated_types import Ge, Gt, Interval
from typing_extensions import Doc

from standoff.core.class_map import map_classes
from standoff.core.errors import ModelError

Chance = Annotated[float, Interval(ge=0, le=1)]
Range = tuple[float, float]

_LIMITS: Final = {
    "mosaic_split": (0.1, 0.9),
    "person_height_px": (1.0, math.inf),
    "other_side_px": (1.0, math.inf),
    "zoom": (0.01, 100.0),
    "shadow_light": (0.0, 1.0),
    "blur_px": (0.3, math.inf),
    "haze_share": (0.0, 1.0),
    "lost_detail_factor": (1.0, math.inf),
    "jpeg_quality": (1, 100),
}
"""Within which ranges must lie; others only have to be positive."""


@dataclass(frozen=True, slots=True)
class AugmentParams:
    """Settings of the augmentation. Ranges are (least, most); pixels are the network's input pixels."""

    rare_share: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc("Pictures with a class that fewer than this share of the draws show are drawn more often; 0 is never."),
    ] = 0.1
    mosaic: Annotated[Chance, Doc("Chance that a sample is made of four pictures, two by two.")] = 0.3
    mosaic_split: Annotated[Range, Doc("Where the four meet, as a part of the width and of the height.")] = (0.3, 0.7)

    aim: Annotated[Chance, Doc("Chance that a view is aimed at an object, rather than anywhere.")] = 0.85
    whole: Annotated[Chance, Doc("Chance that the whole picture is shown instead, as in use.")] = 0.15
    person_classes: Annotated[
        tuple[int, ...] | None,
        Doc("Class ids of people, whose size is drawn by their height; null: those whose names mean a worker."),
    ] = None
    person_height_px: Annotated[Range, Doc("Height of a person that a view is aimed at; log-uniform.")] = (8.0, 80.0)
    other_side_px: Annotated[Range, Doc("Longer side of anything else that a view is aimed at; log-uniform.")] = (
        16.0,
        300.0,
    )
    zoom: Annotated[Range, Doc("Input pixels for each pixel of the picture, whatever size was drawn.")] = (0.3, 2.5)
    least_fill: Annotated[
        float, Gt(0), Doc("A picture is not shrunk below this much of the size at which it just fits.")
    ] = 0.9
    stretch: Annotated[float, Ge(1), Doc("Width to height may change by up to this factor, either way.")] = 1.12
    tilt_deg: Annotated[
        float, Interval(ge=0, le=45), Doc("Rotation either way of pictures that show upright things.")
    ] = 8
    tilted: Annotated[Chance, Doc("Chance of that rotation.")] = 0.5
    mirrored: Annotated[Chance, Doc("Chance of exchanging left and right.")] = 0.5
    any_rotation_sources: Annotated[
        tuple[str, ...],
        Doc("Names of the data sets seen from straight above: turned by quarters, so that up and down change too."),
    ] = ()
    any_angle: Annotated[Chance, Doc("Chance that such a picture is turned by any angle: boxes are looser then.")] = 0.4

    keep_share: Annotated[
        float,
        Interval(ge=0, le=1),
        Doc("A box of which this much is left by the view counts; with less it is ignored."),
    ] = 0.35
    drop_share: Annotated[float, Interval(ge=0, le=1), Doc("A box of which less is left is as good as gone.")] = 0.1
    least_sides_px: Annotated[
        Range, Doc("(shorter, longer) side of a box; smaller ones are ignored, because nobody could find them.")
    ] = (3.0, 5.0)
    cut_out: Annotated[Chance, Doc("Chance that parts are hidden behind patches from elsewhere in the picture.")] = 0.15
    cut_outs: Annotated[int, Ge(1), Doc("Most patches in a picture.")] = 4
    hidden_share: Annotated[float, Interval(ge=0, le=1), Doc("A box of which patches hide more is ignored.")] = 0.6

    shadows: Annotated[Chance, Doc("Chance of cast shadows with soft edges, as of buildings and cranes.")] = 0.2
    shadow_light: Annotated[Range, Doc("Light that is left in a shadow.")] = (0.4, 0.8)
    colour: Annotated[Chance, Doc("Chance of another exposure, contrast and white balance.")] = 0.8
    exposure: Annotated[float, Ge(1), Doc("Brightness changes by up to this factor, either way.")] = 1.4
    gamma: Annotated[float, Ge(1), Doc("Largest power of the tone curve; its inverse is the least.")] = 1.35
    contrast: Annotated[Range, Doc("Factor of the contrast about middle grey.")] = (0.75, 1.25)
    white_balance: Annotated[float, Ge(1), Doc("Each channel changes by up to this factor, either way.")] = 1.1
    hue_deg: Annotated[float, Interval(ge=0, le=180), Doc("Rotation of the hue, either way.")] = 10
    saturation: Annotated[Range, Doc("Factor of the saturation.")] = (0.5, 1.4)
    gray: Annotated[Chance, Doc("Chance of no colour at all.")] = 0.03
    haze: Annotated[Chance, Doc("Chance of haze.")] = 0.15
    haze_share: Annotated[Range, Doc("How much of the light is the haze's.")] = (0.05, 0.4)
    blur: Annotated[Chance, Doc("Chance of one blur: Gaussian, motion in a direction, or defocus.")] = 0.25
    blur_px: Annotated[Range, Doc("Standard deviation of any of them.")] = (0.4, 1.5)
    lost_detail: Annotated[Chance, Doc("Chance that the picture was once smaller.")] = 0.2
    lost_detail_factor: Annotated[Range, Doc("How much smaller each side.")] = (1.2, 2.2)
    noise: Annotated[Chance, Doc("Chance of sensor noise.")] = 0.3
    noise_levels: Annotated[Range, Doc("Standard deviation of the noise, of 255 levels.")] = (1.0, 9.0)
    jpeg: Annotated[Chance, Doc("Chance of JPEG compression.")] = 0.4
    jpeg_quality: Annotated[tuple[int, int], Doc("Its quality.")] = (25, 95)

    def for_classes(self, classes: tuple[str, ...]) -> Self:
        """Return the settings with the class ids of people filled in.

        >>> AugmentParams().for_classes(("car", "Pedestrian")).person_classes
        (1,)
        """
        if self.person_classes is not None:
            return self
        try:
            site_names = map_classes(classes, {}, "the data")
        except ModelError:  # no class of the site
            site_names = {}
        people = tuple(number for number, name in enumerate(classes) if site_names.get(name) == "worker")
        return replace(self, person_classes=people)

    def __post_init__(self) -> None:
        for setting in fields(self):
            if get_args(setting.type)[0] in (Range, tuple[int, int]):
                least, most = getattr(self, setting.name)
                lowest, highest = _LIMITS.get(setting.name, (0.0, math.inf))
                if not lowest <= least <= most <= highest:
                    raise ValueError(
                        f"{setting.name} must be (least, most) within {lowest:g} to {highest:g}, not {(least, most)}"
                    )
