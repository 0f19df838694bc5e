"""What a receiver says, by language, and how it vibrates: data, so that others can have their own."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from importlib.resources import files
from pathlib import Path
from typing import Any, Final

from standoff.core.errors import ConfigError
from standoff.files.yaml_text import read_yaml

_FOLDER: Final = Path(str(files("standoff"))) / "service" / "wearable"
LANGUAGES: Final = tuple(sorted(path.stem.removeprefix("phrases-") for path in _FOLDER.glob("phrases-*.yaml")))


@dataclass(frozen=True, slots=True)
class Phrases:
    """The words of one language.

    Attributes:
        language: Its code.
        words: By name; `{name}` in them is filled in.
    """

    language: str
    words: Mapping[str, str]

    @classmethod
    def read(cls, language: str) -> Phrases:
        """Read a catalogue.

        Raises:
            ConfigError: There is none.
        """
        if language not in LANGUAGES:
            raise ConfigError(expected=f"a language, {', '.join(LANGUAGES)}", found=language, fix="choose one of them")
        told = read_yaml(_FOLDER / f"phrases-{language}.yaml", "phrases", ConfigError)
        return cls(language, {str(name): str(text) for name, text in dict(told or {}).items()})

    def say(self, name: str, **parts: object) -> str:
        """Return a phrase with its parts filled in; a name without a phrase as it is.

        >>> Phrases.read("en").say("distance", distance="4.2")
        '4.2 m away'
        """
        text = self.words.get(name)
        return name if text is None else text.format(**parts)


def read_vibrations() -> dict[str, tuple[tuple[int, ...], int]]:
    """Return by level the pattern (milliseconds on, off, on, ...) and how often it comes.

    Raises:
        ConfigError: The file is damaged.
    """
    path = _FOLDER / "vibrations.yaml"
    told: Any = read_yaml(path, "vibration patterns", ConfigError)
    return {str(level): (tuple(map(int, one["pattern_ms"])), int(one["times"])) for level, one in dict(told).items()}
