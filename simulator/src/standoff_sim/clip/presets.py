"""The named clips, each as its difference from the default, and the plan of one clip to be rendered."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal

from standoff.core.errors import ConfigError
from standoff_sim.people.anthropometry import MEAN_STATURE_M

Condition = Literal["noon", "afternoon", "low_sun", "hazy", "overcast", "dusk"]
"""Weather and hour."""

FlightStyle = Literal["hover", "orbit", "pass", "away", "hand"]
"""How the camera moves; `standoff_sim.camera.flight.make_flight` says what each does."""

MAX_SEED = 2**31 - 1
_MIN_SIDE_PX, _MAX_SIDE_PX = 64, 7680
_MAX_FRAMES = 100_000


@dataclass(frozen=True, slots=True)
class CoverPlan:
    """What lies on the reference object, and when.

    Attributes:
        kind: of `standoff_sim.scene.covers.make_cover`.
        start: When it appears, as a share of the clip.
        stop: When it is gone, as a share of the clip.
    """

    kind: str
    start: float
    stop: float


@dataclass(frozen=True, slots=True)
class Preset:
    """One kind of clip.

    Attributes:
        summary: One line for `standoff simulate --list`.
        cast: Who does what; a name of `standoff_sim.scene.casting.CASTS`.
        width_px: Of the picture.
        height_px: Of the picture.
        frames: Number of them.
        fps: Frames a second.
        altitude_m: Of the camera above the site's datum.
        pitch_deg: Of the gimbal, downwards from the horizon.
        field_deg: Horizontal field of view.
        motion: How the drone flies; a style of `standoff_sim.camera.flight.make_flight`.
        shape: Of the reference object, a kind of `standoff_sim.scene.reference`; None for none.
        covers: What lies on it.
        style: Of the site, one of `standoff_sim.ground.site_plans.SiteStyle`.
        soil: Of the open ground, one of `standoff_sim.ground.terrain_plan.Soil`; None draws one.
        condition: Of the light; see `standoff_sim.scene.light.random_light`.
        clutter: Density of props, 1 is a busy site.
        furnished_m: Props stand within this distance of the middle; None: where the camera looks.
        reference_offset_m: Right of and beyond the middle of the picture, of the reference object's centre.
        bit_rate_mbps: Of the film; None is a drone's own.
    """

    summary: str
    cast: str
    width_px: int = 1920
    height_px: int = 1080
    frames: int = 240
    fps: float = 30.0
    altitude_m: float = 24.0
    pitch_deg: float = 52.0
    field_deg: float = 70.0
    motion: FlightStyle = "hover"
    shape: str | None = "square_footing"
    covers: tuple[CoverPlan, ...] = ()
    style: str = "earthworks"
    soil: str | None = None
    condition: Condition = "afternoon"
    clutter: float = 1.0
    furnished_m: float | None = None
    reference_offset_m: tuple[float, float] = (-3.0, -2.0)
    bit_rate_mbps: float | None = None


PRESETS: Mapping[str, Preset] = MappingProxyType(
    {
        "mobile": Preset(
            "The paper's mobile test: worker, loader and excavator about a 2.89 m footing, sand on it for a while.",
            "mobile", width_px=3840, height_px=2140, frames=398, soil="brown earth", condition="overcast",
            covers=(CoverPlan("sand_side", 0.40, 0.56),),
        ),
        "stationary-15": Preset(
            "The paper's stationary test: worker and excavator exactly 15 m apart, quadrilateral footing, hand-held.",
            "stationary-15", frames=50, motion="hand", shape="quadrilateral_footing", style="foundations",
            soil="brown earth", condition="overcast",
        ),
        "stationary-20": Preset(
            "The same, exactly 20 m apart.",
            "stationary-20", frames=50, motion="hand", shape="quadrilateral_footing", style="foundations",
            soil="red clay", condition="overcast", altitude_m=27.0,
        ),
        "virtual": Preset(
            "The paper's virtual test (8.2): nothing on the reference object and little around it.",
            "mobile", frames=120, clutter=0.15, soil="brown earth", condition="overcast",
        ),
        "board": Preset(
            "The paper's lab test at full size: a checkerboard of 25 m under a drone.",
            "board", frames=148, motion="orbit", shape="board", style="yard", altitude_m=38.0, condition="overcast",
            clutter=0.5, reference_offset_m=(0.0, 0.0),
        ),
        "busy": Preset(
            "Eight workers, five machines, much in front of much.",
            "busy", motion="orbit", altitude_m=22.0, pitch_deg=42.0, style="structure", clutter=1.4,
            covers=(CoverPlan("plate", 0.55, 0.75),),
        ),
        "ordinary": Preset(
            "A site as it usually is: machines on ground of their own, people elsewhere, now and then a short cut.",
            "ordinary", altitude_m=45.0, pitch_deg=60.0, style="foundations", clutter=0.6,
        ),
        "far": Preset(
            "From 60 m: workers are under 25 px tall.",
            "busy", altitude_m=60.0, pitch_deg=62.0, motion="pass", style="road", condition="hazy",
        ),
        "grazing": Preset(
            "Pitch 30 degrees: long views, small angles, things hide each other.",
            "mobile", altitude_m=17.0, pitch_deg=30.0, condition="low_sun", style="structure",
            reference_offset_m=(-3.0, -4.0),
        ),
        "lost-reference": Preset(
            "The reference object leaves the picture and comes back.",
            "mobile", frames=300, motion="away", condition="overcast", style="foundations",
        ),
        "night-ish": Preset(
            "Dusk: low light, high gain, noise.",
            "mobile", condition="dusk", style="yard",
        ),
        "demo": Preset(
            "The clip that standoff ships: one near miss and one breach at a wheel loader, an excavator apart.",
            "demo", frames=250, fps=25.0, altitude_m=23.0, soil="brown earth", clutter=0.6, bit_rate_mbps=5.6,
            reference_offset_m=(-1.0, -3.5),
        ),
    }
)  # fmt: skip


@dataclass(frozen=True, slots=True)
class Plan:
    """One clip: a preset with its seed and everything that the caller changed.

    Attributes:
        name: Of the preset.
        preset: The preset after the changes.
        seed: Of everything random.
        masks: Whether masks go into the annotations.
        variable_rate: Whether the time between frames varies.
        excavator_mesh: Folder of parts in place of the procedural excavators, or None.
        stature_m: Mean of the workers', barefoot.
        stooping: Share of the workers who work bent over for much of the time.
        devices: Whether wearables report positions, in `devices.parquet`.
        camera: Which drone films, from 1; all film the same scene, from different sides.
    """

    name: str
    preset: Preset
    seed: int
    masks: bool = False
    variable_rate: bool = False
    excavator_mesh: Path | None = None
    stature_m: float = MEAN_STATURE_M
    stooping: float = 0.0
    devices: bool = False
    camera: int = 1

    @property
    def duration_s(self) -> float:
        """Return the clip's length at its nominal rate."""
        return self.preset.frames / self.preset.fps


def plan_clip(
    name: str,
    *,
    seed: int = 0,
    masks: bool = False,
    variable_rate: bool = False,
    excavator_mesh: Path | None = None,
    stature_m: float = MEAN_STATURE_M,
    stooping: float = 0.0,
    devices: bool = False,
    **changes: float | None,
) -> Plan:
    """Look up a preset and change it.

    Args:
        name: Of the preset.
        seed: Of everything random.
        masks: Whether masks go into the annotations.
        variable_rate: Whether the time between frames varies.
        excavator_mesh: Folder of parts in place of the procedural excavators, or None.
        stature_m: Mean of the workers', barefoot.
        stooping: Share of the workers who work bent over for much of the time.
        devices: Whether wearables report positions.
        changes: Fields of `Preset` with new values; None leaves the preset's own.

    Raises:
        ConfigError: Unknown preset, or a number out of its range.
    """
    if name not in PRESETS:
        raise ConfigError(
            expected=f"one of the presets {', '.join(PRESETS)}",
            found=repr(name),
            fix="run standoff simulate --list to see what each is",
        )
    given = {key: value for key, value in changes.items() if value is not None}
    preset = replace(PRESETS[name], **given)  # type: ignore[arg-type]
    check_seed(seed)
    check_size(preset.width_px, preset.height_px)
    _check("number of frames", preset.frames, 1, _MAX_FRAMES)
    _check("frames a second", preset.fps, 1, 240)
    _check("altitude in m", preset.altitude_m, 5, 200)
    _check("pitch in degrees", preset.pitch_deg, 10, 90)
    _check("mean stature in m", stature_m, 1.4, 2.1)
    _check("share of workers who stoop", stooping, 0, 1)
    return Plan(name, preset, seed, masks, variable_rate, excavator_mesh, stature_m, stooping, devices)


def check_seed(seed: int) -> None:
    """Refuse a seed that the generators cannot take.

    Raises:
        ConfigError: Out of range.
    """
    _check("seed", seed, 0, MAX_SEED)


def check_size(width_px: int, height_px: int) -> None:
    """Refuse a picture size that cannot be drawn or encoded.

    Raises:
        ConfigError: Too small, too large or odd.
    """
    sides = (width_px, height_px)
    if not all(_MIN_SIDE_PX <= side <= _MAX_SIDE_PX and side % 2 == 0 for side in sides):
        raise ConfigError(
            expected=f"a width and height from {_MIN_SIDE_PX} to {_MAX_SIDE_PX} px, both even (H.264)",
            found=f"{width_px}x{height_px}",
            fix="choose for example 1920x1080",
        )


def _check(what: str, value: float, low: float, high: float) -> None:
    if not low <= value <= high:
        raise ConfigError(
            expected=f"a {what} from {low} to {high}", found=f"{value:g}", fix="choose a number in this range"
        )
