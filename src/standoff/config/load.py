"""Read settings. Sources, strongest first: the command line, the environment, the YAML file, the defaults."""

from __future__ import annotations

import copy
import os
from collections.abc import Iterator, Mapping
from difflib import SequenceMatcher, get_close_matches
from pathlib import Path
from typing import Any, Final

from pydantic import ValidationError
from pydantic_core import ErrorDetails
from pydantic_settings import BaseSettings, InitSettingsSource, PydanticBaseSettingsSource

from standoff.clips import DETECTIONS_FILE
from standoff.config.settings import Settings
from standoff.core.errors import ConfigError
from standoff.files.yaml_text import read_yaml
from standoff.stages.detect import SHIPPED_MODELS, find_ground_points, find_model

_SECRET_NAMES: Final = frozenset({"password", "secret", "apprise"})
"""What stands there by mistake may be the secret itself."""


def _clause(error: ErrorDetails) -> str:
    """Return one pydantic error as `where: what (found ...)`."""
    where = ".".join(str(part) for part in error["loc"])
    message = error["msg"].removeprefix("Value error, ")
    found = "" if _may_be_secret(error) else f" (found {error['input']!r})"
    return f"{where}: {message}{found}" if where else message


def _may_be_secret(error: ErrorDetails) -> bool:
    given = error["input"]
    if isinstance(given, (dict, list)) or not _SECRET_NAMES.isdisjoint(error["loc"]):
        return True
    # A name that is mistyped may be a secret's, and an address may hold credentials.
    return error["type"] == "extra_forbidden" or "://" in str(given)


_ALIKE: Final = 0.85
"""Share of letters that two names have in common, in order, where one is likely the other, mistyped."""
_ADVICE: Final = "correct them; `standoff config show` lists every setting with its meaning and bounds"


def config_error(origin: str, error: ValidationError, advice: str = _ADVICE) -> ConfigError:
    """Return what is wrong with settings, in one line; at most three mistakes in full."""
    clauses = [_clause(one) for one in error.errors()]
    more = f"; and {len(clauses) - 3} more" if len(clauses) > 3 else ""
    return ConfigError(
        expected=f"valid settings in {origin}",
        found="; ".join(clauses[:3]) + more,
        fix=advice,
    )


def read_settings_file(path: Path) -> dict[str, Any]:
    """Read a YAML file of settings by name.

    Raises:
        ConfigError: It cannot be read, or holds something else.
    """
    loaded = read_yaml(path, "a settings file", ConfigError)
    if loaded is None:
        return {}
    if not isinstance(loaded, dict):
        raise ConfigError(
            expected=f"settings by name in {path}", found=type(loaded).__name__, fix="write `name: value` lines"
        )
    return loaded


_NAMED: Final = {"model": SHIPPED_MODELS, "telemetry": ("none",)}
"""What stands in place of a path and is none."""


def anchor_paths(settings: dict[str, Any], folder: Path) -> None:
    """Make paths absolute: those of a file are relative to it, not to wherever the program was started."""
    ground, source = settings.get("ground"), settings.get("source")
    places = (
        (settings, "model"),
        (settings, "detections"),
        (source, "telemetry"),
        (settings, "zones"),
        (ground, "survey"),
        (ground, "camera"),
    )
    for section, name in places:
        if not isinstance(section, dict) or not isinstance(section.get(name), str):
            continue
        if section[name] not in _NAMED.get(name, ()):
            section[name] = _anchored(section[name], name, folder)


def _anchored(given: str, name: str, folder: Path) -> str:
    try:
        return str((folder / given).resolve())
    except ValueError:
        raise ConfigError(expected=f"a path in `{name}`", found=repr(given), fix="correct it") from None


def _check_environment() -> None:
    """Raise ConfigError for a variable that looks like a setting and is none: it would be passed over."""
    prefix = str(Settings.model_config.get("env_prefix", ""))
    sections = [f"{prefix}{name.upper()}" for name in Settings.model_fields]
    known = {_letters(name): name for name in _variables(resolved(Settings.model_construct()), prefix)}
    for variable in os.environ:
        named = variable.upper()
        if named.partition("__")[0] in sections:
            continue
        nearest = _nearest(named, known)
        if named.startswith(prefix) or (nearest and _begins_like(named, prefix)):
            meant = f", or write {nearest} if that is what is meant" if nearest else ""
            file = "; a settings file is named with --config" if _letters(named) == _letters(f"{prefix}config") else ""
            raise ConfigError(
                expected=f"settings in variables that begin with {prefix}",
                found=variable,
                fix=f"unset it{meant}{file}; `standoff config show` lists every setting",
            )


def _nearest(named: str, known: Mapping[str, str]) -> str:
    """Return the variable of a setting whose letters are nearly those of another one; "" if there is none.

    Args:
        named: The other one.
        known: Variables of settings by their letters.
    """
    near = get_close_matches(_letters(named), known, n=1, cutoff=_ALIKE)
    return known[near[0]] if near else ""


def _variables(settings: Mapping[str, Any], prefix: str) -> Iterator[str]:
    """Yield the names of variables, those of sections too."""
    for name, value in settings.items():
        variable = f"{prefix}{name.upper()}"
        yield variable
        if isinstance(value, Mapping):
            yield from _variables(value, f"{variable}__")


def _letters(name: str) -> str:
    return name.upper().replace("_", "")


def _begins_like(named: str, prefix: str) -> bool:
    """Tell a program's own prefix, mistyped, from another program's: most of it must be there."""
    own = _letters(prefix)
    return SequenceMatcher(None, _letters(named)[: len(own)], own).ratio() >= _ALIKE


def load_settings(path: Path | str | None = None, overrides: Mapping[str, Any] | None = None) -> Settings:
    """Read the settings file, the environment and the overrides into one checked tree.

    Args:
        path: YAML file; paths in it are relative to it. None: defaults.
        overrides: Nested settings that win over everything else, as the command line gives them.

    Raises:
        ConfigError: A file that cannot be read, a name that does not exist, a value out of bounds.
    """
    from_file: dict[str, Any] = {}
    if path is not None:
        path = Path(path)
        from_file = read_settings_file(path)
        anchor_paths(from_file, path.parent)
    return settings_from(from_file, str(path) if path else "the command line and environment", overrides)


def settings_from(from_file: Mapping[str, Any], origin: str, overrides: Mapping[str, Any] | None = None) -> Settings:
    """Check settings by name, under the environment and the overrides.

    Args:
        from_file: Nested settings, their paths absolute.
        origin: Where they stand, for the message.
        overrides: As for `load_settings`.

    Raises:
        ConfigError: A name that does not exist, a value out of bounds.
    """
    _check_environment()
    from_caller = copy.deepcopy(dict(overrides or {}))
    anchor_paths(from_caller, Path.cwd())
    # YAML has whole numbers as names, too: no setting has one.
    named = {str(name): value for name, value in from_file.items()}

    class _FileSettings(Settings):
        @classmethod
        def settings_customise_sources(
            cls,
            settings_cls: type[BaseSettings],
            init_settings: PydanticBaseSettingsSource,
            env_settings: PydanticBaseSettingsSource,
            dotenv_settings: PydanticBaseSettingsSource,
            file_secret_settings: PydanticBaseSettingsSource,
        ) -> tuple[PydanticBaseSettingsSource, ...]:
            return init_settings, env_settings, InitSettingsSource(settings_cls, named)

    try:
        made = _FileSettings(**from_caller)
    except ValidationError as error:
        raise config_error(origin, error) from error
    # Of the class itself: one that is made in a function cannot be pickled, and goes to no other process.
    return Settings.model_construct(made.model_fields_set, **dict(made))


def recorded_settings(record: Mapping[str, Any], run: str) -> Settings:
    """Return the settings that a run was made with; the environment of today does not change them.

    Args:
        record: What the run says of itself.
        run: Where it is, for the message.

    Raises:
        ConfigError: It has no settings, or another version's.
    """
    settings = record.get("settings")
    if not isinstance(settings, Mapping) or not settings:
        raise ConfigError(
            expected=f"the settings of the run in {run}", found="none", fix="give the folder that `standoff run` wrote"
        )
    return settings_from({}, f"the record of {run}", settings)


def named_files(settings: Settings) -> dict[str, Path]:
    """Return the files that a run with these settings reads beside its source, by the setting that names them.

    Detectors and recordings of a replacement, and what its code is, nobody here knows.

    Raises:
        ModelError: standoff was installed without a detector of its own.
    """
    ground, zones = settings.ground, settings.zones
    found = {"zones": zones, "ground.survey": ground.survey, "ground.camera": ground.camera}
    if settings.detections is not None:
        is_run = settings.detections.is_dir()
        found["detections"] = settings.detections / DETECTIONS_FILE if is_run else settings.detections
    elif "detect" not in settings.replace:
        found["model"] = find_model(settings.model)
        for file in find_ground_points(settings.detect.ground_points):
            found[f"detect.ground_points/{file.name}"] = file
    return {name: Path(path) for name, path in found.items() if path is not None}


def resolved(settings: Settings) -> dict[str, Any]:
    """Return the settings as plain JSON values, every default filled in."""
    return settings.model_dump(mode="json")
