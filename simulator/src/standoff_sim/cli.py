"""`standoff simulate ...`: a construction site with exact truth, as a clip or as pictures for training."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from typer.core import TyperGroup

from standoff.cli.numbers import size_or_none
from standoff_sim.cli_composites import composites
from standoff_sim.clip.presets import MAX_SEED, PRESETS
from standoff_sim.people.anthropometry import MEAN_STATURE_M


class _Presets(TyperGroup):
    """Commands whose unknown names are unknown presets."""

    def resolve_command(self, ctx: Any, args: list[str]) -> Any:  # noqa: ANN401 - typer has its own click
        from standoff_sim.clip.presets import plan_clip

        if args[0] not in self.commands and not args[0].startswith("-"):
            plan_clip(args[0])
        return super().resolve_command(ctx, args)


app = typer.Typer(
    cls=_Presets,
    help="Render a construction site whose every position, box and pixel is known.",
    invoke_without_command=True,
)
_Out = Annotated[
    Path, typer.Option("--out", "-o", help="Folder for the files; appears when all is done.", show_default=False)
]
_Seed = Annotated[int, typer.Option(help=f"Of everything random, 0 to {MAX_SEED}; the same seed gives the same truth.")]
_Processes = Annotated[int, typer.Option(min=1, help="That render side by side; the result does not depend on it.")]
_Overwrite = Annotated[bool, typer.Option("--overwrite", help="Replace the folder if it exists.")]
_Quiet = Annotated[bool, typer.Option("--quiet", "-q", help="No progress bar.")]


@app.callback()
def _presets(
    context: typer.Context,
    wanted: Annotated[bool, typer.Option("--list", help="Print the presets and what each shows.")] = False,
) -> None:
    from standoff.cli.console import print_table

    if wanted:
        rows = [
            (name, preset.summary, f"{preset.width_px}x{preset.height_px}", str(preset.frames))
            for name, preset in PRESETS.items()
        ]
        columns = ("preset", "what it shows", "size", "frames")
        print_table("standoff simulate PRESET --out DIR", columns, rows, texts=2)
    elif context.invoked_subcommand is None:
        typer.echo(context.get_help())


def _clip_command(name: str) -> Callable[..., None]:
    def render(
        out: _Out,
        seed: _Seed = 0,
        size: Annotated[str | None, typer.Option(help="Of the picture, WIDTHxHEIGHT px.")] = None,
        frames: Annotated[int | None, typer.Option(help="How many.")] = None,
        fps: Annotated[float | None, typer.Option(help="Frames a second.")] = None,
        altitude: Annotated[float | None, typer.Option(help="Of the camera; m.")] = None,
        pitch: Annotated[float | None, typer.Option(help="Of the gimbal below the horizon; degrees.")] = None,
        variable_rate: Annotated[bool, typer.Option("--variable-rate", help="Vary the time between frames.")] = False,
        masks: Annotated[bool, typer.Option("--masks", help="Masks in annotations.json as well.")] = False,
        excavator_mesh: Annotated[
            Path | None, typer.Option(help="Folder of COLLADA or glTF parts in place of the procedural excavator.")
        ] = None,
        stature: Annotated[float, typer.Option(help="Mean of the workers', barefoot; m.")] = MEAN_STATURE_M,
        stooping: Annotated[float, typer.Option(help="Share of the workers who work bent over, 0 to 1.")] = 0.0,
        truth_only: Annotated[
            bool, typer.Option("--truth-only", help="No pictures: the truth, and detections as noisy as a detector's.")
        ] = False,
        cameras: Annotated[
            int, typer.Option(min=1, max=2, help="Drones over one scene; with 2, a clip of each in its own folder.")
        ] = 1,
        devices: Annotated[
            bool, typer.Option("--devices", help="Positions that wearables report, in devices.parquet as well.")
        ] = False,
        processes: _Processes = 2,
        overwrite: _Overwrite = False,
        quiet: _Quiet = False,
    ) -> None:
        from standoff.cli.console import progress
        from standoff_sim.clip.presets import plan_clip
        from standoff_sim.clip.write_clip import record_cameras, record_clip, record_truth

        width_px, height_px = size_or_none(size)
        plan = plan_clip(
            name, seed=seed, masks=masks, variable_rate=variable_rate, excavator_mesh=excavator_mesh,
            stature_m=stature, stooping=stooping, devices=devices, frames=frames,
            fps=fps, altitude_m=altitude, pitch_deg=pitch, width_px=width_px, height_px=height_px,
        )  # fmt: skip
        record, verb = (record_truth, "surveying") if truth_only else (record_clip, "rendering")
        with progress(f"{verb} {name}", plan.preset.frames * cameras, quiet=quiet) as step:
            options: dict[str, Any] = {"overwrite": overwrite, "processes": processes, "on_frame": step}
            if cameras == 1:
                record(plan, out, **options)
            else:
                record_cameras(record, plan, out, cameras=cameras, **options)
        clip = out if cameras == 1 else out / "camera-1"
        if truth_only:
            typer.echo(f"the truth and noisy detections, without pictures, in {clip}")
        else:
            typer.echo(f"{clip}/video.mp4 and its truth; measure with: standoff evaluate paper {clip}")

    render.__doc__ = PRESETS[name].summary
    return render


for _name in PRESETS:
    app.command(_name)(_clip_command(_name))
app.command()(composites)


@app.command()
def dataset(
    out: _Out,
    images: Annotated[int, typer.Option(min=1, help="How many in all.", show_default=False)],
    per_scene: Annotated[int, typer.Option(min=1, help="Pictures of each scene, all different.")] = 10,
    size: Annotated[str, typer.Option(help="Of the pictures, WIDTHxHEIGHT px.")] = "1280x720",
    layout: Annotated[Literal["yolo", "coco"], typer.Option(help="Of the annotations.")] = "yolo",
    held_out: Annotated[float, typer.Option(min=0, max=0.5, help="Share of scenes for each of val and test.")] = 0.1,
    seed: _Seed = 0,
    excavator_mesh: Annotated[
        Path | None, typer.Option(help="Folder of COLLADA or glTF parts for some of the excavators.")
    ] = None,
    mesh_share: Annotated[float, typer.Option(min=0, max=1, help="Of the scenes whose excavators these are.")] = 1 / 3,
    cast: Annotated[
        Literal["random", "excavators", "machines"],
        typer.Option(help="Who is there: anybody; or excavators, or other machines, as many as find room, and people."),
    ] = "random",
    processes: _Processes = 2,
    overwrite: _Overwrite = False,
    quiet: _Quiet = False,
) -> None:
    """Render independent scenes for training, split by scene."""
    from standoff.cli.console import progress
    from standoff_sim.clip.dataset import DatasetPlan, record_dataset

    width_px, height_px = size_or_none(size)
    plan = DatasetPlan(
        images=images, per_scene=per_scene, width_px=width_px or 0, height_px=height_px or 0, layout=layout,
        held_out=held_out, seed=seed, excavator_mesh=excavator_mesh, mesh_share=mesh_share, cast=cast,
    )  # fmt: skip
    with progress("rendering", images, quiet=quiet, unit="pictures") as step:
        record_dataset(plan, out, overwrite=overwrite, processes=processes, on_picture=step)
    typer.echo(f"{images} pictures in {out}")
