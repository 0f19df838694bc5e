"""The site's settings file: what the draft says goes in, what somebody wrote by hand stays, comments included."""

from __future__ import annotations

import io
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Final

from ruamel.yaml import YAML
from ruamel.yaml.comments import CommentedMap
from ruamel.yaml.error import YAMLError

from standoff.config import anchor_paths, read_settings_file, settings_from
from standoff.core.errors import ConfigError
from standoff.files.plain_text import read_text
from standoff.files.whole import whole_file
from standoff.files.yaml_text import write_yaml
from standoff.files.zone_file import write_zones
from standoff.service.setup.draft import Draft

_HEAD: Final = "# What `standoff setup` was shown of a site. Every name: `standoff config show`.\n"


def read_site(path: Path) -> dict[str, Any]:
    """Return the settings of a site's file by name, their paths absolute; none where it is not there.

    Raises:
        ConfigError: It holds something else.
    """
    if not path.is_file():
        return {}
    settings = read_settings_file(path)
    anchor_paths(settings, path.resolve().parent)
    settings_from(settings, str(path))
    return settings


def save_site(path: Path, draft: Draft, size_px: tuple[int, int]) -> list[Path]:
    """Write a draft into a site's file, and what belongs to it beside it; each file whole or not at all.

    Args:
        path: Settings file; what it says of other things stays, comments too.
        draft: What to write.
        size_px: (width, height) of the pictures.

    Returns:
        The files that were written, the settings first.

    Raises:
        ConfigError: Together they would be no valid settings.
        OutputError: A file cannot be written.
    """
    survey, zones = path.with_name(f"{path.stem}-survey.yaml"), path.with_name(f"{path.stem}-zones.geojson")
    written = [path]
    if draft.ground == "survey":
        write_yaml(survey, draft.survey_text(size_px))
        written.append(survey)
    if draft.zones:
        write_zones(zones, draft.zones_of_site())
        written.append(zones)
    text = _merged_text(path, draft.settings(Path(survey.name), Path(zones.name)))
    with whole_file(path) as partial:
        partial.write_text(text, encoding="utf-8")
        # Not before it has been read as a run will read it.
        content = read_settings_file(partial)
        anchor_paths(content, path.resolve().parent)
        settings_from(content, str(path))
    return written


def _merged_text(path: Path, own: Mapping[str, Any]) -> str:
    yaml = YAML(typ="rt")
    yaml.preserve_quotes = True
    yaml.width = 120
    content: Any = CommentedMap()
    before = ""
    if path.is_file():
        before = read_text(path, "a settings file", ConfigError)
        try:
            content = yaml.load(before) or CommentedMap()
        except YAMLError as error:
            raise ConfigError(
                expected=f"a settings file at {path}", found=str(error).splitlines()[0], fix="correct or move the file"
            ) from error
    _lay_over(content, own)
    text = io.StringIO()
    yaml.dump(content, text)
    return text.getvalue() if before else _HEAD + text.getvalue()


def _lay_over(content: Any, own: Mapping[str, Any]) -> None:  # noqa: ANN401
    """Put settings into a mapping in place: what is none goes, what is the same stays as it was written."""
    for name, value in own.items():
        if value is None or value == {}:
            content.pop(name, None)
        elif isinstance(value, Mapping):
            if not isinstance(content.get(name), Mapping):
                content[name] = CommentedMap()
            if name == "reference":
                # The shape may have been said in another way.
                for other in set(content[name]) & _SHAPES - set(value):
                    del content[name][other]
            _lay_over(content[name], value)
            if not content[name]:
                del content[name]
        elif content.get(name) != value:
            content[name] = value


_SHAPES: Final = frozenset(
    {
        "square_m",
        "rectangle_m",
        "regular_m",
        "sides_m",
        "diagonal_m",
        "corners_m",
    }
)
"""Names in `ground.reference` of which only those that the draft gives may stay."""
