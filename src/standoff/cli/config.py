"""`standoff config show` and `standoff config check`."""

from __future__ import annotations

import textwrap
from collections.abc import Iterable, Iterator
from dataclasses import fields, is_dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, get_args, get_type_hints

import typer

from standoff.core.errors import ConfigError

if TYPE_CHECKING:
    from standoff.config import Settings, SiteSettings

app = typer.Typer(help="Show or check the settings.", no_args_is_help=True)
_ConfigOption = Annotated[Path | None, typer.Option("--config", help="Settings, YAML. Absent: the defaults.")]


def _annotations(section: object) -> Iterator[tuple[str, str, str]]:
    """Yield (name, meaning, bounds) of every setting of a section, pydantic model or plain dataclass."""
    from pydantic import BaseModel
    from typing_extensions import Doc

    if isinstance(section, BaseModel):
        for name, info in type(section).model_fields.items():
            yield name, info.description or "", _bounds(info.metadata)
    else:
        assert is_dataclass(section)
        hints = get_type_hints(type(section), include_extras=True)
        for field in fields(section):
            extras = get_args(hints[field.name])[1:]
            meaning = next((extra.documentation for extra in extras if isinstance(extra, Doc)), "")
            yield field.name, meaning, _bounds(extras)


def _bounds(extras: Iterable[object]) -> str:
    signs = {"gt": ">", "ge": ">=", "lt": "<", "le": "<="}
    return " and ".join(
        f"{sign} {limit}"
        for extra in extras
        for name, sign in signs.items()
        if (limit := getattr(extra, name, None)) is not None
    )


def _yaml_lines(section: object, indent: str = "") -> Iterator[str]:
    """Yield a section as YAML in which every setting carries its meaning and bounds as a comment."""
    from pydantic import BaseModel, TypeAdapter

    from standoff.files.yaml_text import dump_yaml

    for name, meaning, bounds in _annotations(section):
        comment = f"{meaning} [{bounds}]" if bounds else meaning
        yield from textwrap.wrap(comment, 118, initial_indent=f"{indent}# ", subsequent_indent=f"{indent}# ")
        value = getattr(section, name)
        if isinstance(value, BaseModel) or is_dataclass(value):
            yield f"{indent}{name}:"
            yield from _yaml_lines(value, indent + "  ")
        else:
            plain = TypeAdapter(Any).dump_python(value, mode="json")
            text = dump_yaml(plain, flow=True, width=10_000).removesuffix("...\n").strip()
            yield f"{indent}{name}: {text}"


@app.command()
def show(
    config: _ConfigOption = None,
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON, without the meanings.")] = False,
) -> None:
    """Print every setting with its value, meaning and bounds, as YAML that `run --config` reads."""
    from standoff.cli.console import write_json
    from standoff.config import is_site, load_settings, load_site, read_settings_file, resolved

    if config is not None and is_site(read_settings_file(config)):
        _show_site(load_site(config), as_json=as_json)
        return
    settings = load_settings(config)
    if as_json:
        write_json(resolved(settings), Path("-"))
        return
    typer.echo("\n".join(_yaml_lines(settings)))


def _show_site(site: SiteSettings, *, as_json: bool) -> None:
    """Print the settings of a site; of secrets only where they come from."""
    from standoff.cli.console import write_json
    from standoff.config import resolved

    if as_json:
        streams = {
            name: {"address": str(one.live_address), **one.capture.model_dump(mode="json"), **resolved(one.settings)}
            for name, one in site.streams.items()
        }
        told = {**site.live.model_dump(mode="json"), "defaults": resolved(site.defaults), "streams": streams}
        write_json(told, Path("-"))
        return
    lines = [*_yaml_lines(site.live), "defaults:", *_yaml_lines(site.defaults, "  "), "streams:"]
    for name, one in site.streams.items():
        lines += [f"  {name}:", f"    address: {one.live_address}", *_yaml_lines(one.capture, "    ")]
    typer.echo("\n".join(lines))


@app.command()
def check(file: Annotated[Path, typer.Argument(help="Settings, YAML.", show_default=False)]) -> None:
    """Check a settings file, of a run or of a live site, and all that it points to: model, survey, camera, films."""
    from standoff.config import is_site, load_settings, load_site, read_settings_file

    if is_site(read_settings_file(file)):
        site = load_site(file)
        for name, stream in site.streams.items():
            address = stream.live_address
            if address.scheme == "replay" and not address.path.is_file():
                raise ConfigError(
                    expected=f"a film at streams.{name}.address", found=f"no {address.path}", fix="correct the path"
                )
            _check_stages(stream.settings)
    else:
        _check_stages(load_settings(file))
    typer.echo(f"{file}: all settings are valid, and the files that they name can be used.")


def _check_stages(settings: Settings) -> None:
    """Make all stages and find all outputs; say what is doubtful."""
    from standoff.config import STAGE_NAMES, build_stage, import_factory
    from standoff.monitor import warnings_of

    for name in STAGE_NAMES:
        for warning in warnings_of(build_stage(name, settings)):
            typer.echo(f"standoff: warning: {warning}", err=True)
    for replacement in settings.extra_outputs.values():
        import_factory(replacement)
