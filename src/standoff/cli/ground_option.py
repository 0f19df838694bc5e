"""What `standoff run` is told of the ground on the command line, as settings."""

from __future__ import annotations

from pathlib import Path
from typing import Any

from standoff.core.errors import ConfigError
from standoff.core.lengths import TypedLength

_SHAPES = {"square": "SIDE", "rectangle": "LENGTH,WIDTH", "regular": "SIDES,LENGTH", "polygon": "X,Y,X,Y,X,Y,..."}
"""How `--ground` names the shapes of reference objects, and what has to follow."""


class GroundOption:
    """`--ground`, `--reference-box` and `--camera`.

    Args:
        ground: Of `--ground`; None: not given.
        box: Of `--reference-box`.
        camera: Of `--camera`.

    Attributes:
        settings: What they say, as the section `ground`.

    Raises:
        ConfigError: They cannot be read.
    """

    def __init__(self, ground: str | None, box: str | None, camera: Path | None) -> None:
        self._lengths: list[TypedLength] = []
        self.settings: dict[str, Any] = {}
        if ground is not None:
            self._take(ground)
        if box is not None:
            self.settings.setdefault("reference", {})
            if self.settings["reference"] is None:
                raise ConfigError(
                    expected="--reference-box together with a reference object",
                    found=f"--ground {ground}",
                    fix="use --ground square:SIDE, or describe the reference in the settings file",
                )
            self.settings["reference"]["box_px"] = _numbers(box, 4, "--reference-box")
        if camera is not None:
            self.settings["camera"] = str(camera)
        if self._bare and len(self._bare) < len(self._measured):
            self._refuse_bare("one of them has a unit")

    def check_units(self, unit: str) -> None:
        """Refuse lengths without a unit where people read feet: they may mean either, and one is three times the other.

        Raises:
            ConfigError: There are some.
        """
        if unit != "metres" and self._bare:
            self._refuse_bare(f"lengths are shown in {unit}")

    @property
    def _measured(self) -> list[TypedLength]:
        return [one for one in self._lengths if one.length_m != 0.0]

    @property
    def _bare(self) -> list[TypedLength]:
        return [one for one in self._measured if not one.names_unit]

    def _refuse_bare(self, because: str) -> None:
        text = self._bare[0].text
        raise ConfigError(
            expected=f"a unit behind every length of --ground, because {because}",
            found=repr(text),
            fix=f"write {text}m or {text}ft",
        )

    def _take(self, ground: str) -> None:
        if ground.startswith("marker:"):
            self.settings |= self._marker(ground)
            self.settings["auto"] = True
        elif ground in ("auto", "none"):
            self.settings |= {"survey": None, "reference": None, "auto": ground == "auto"}
        else:
            shape = self._shape(ground)
            self.settings |= {"survey": None if shape else ground, "reference": shape}
        if ground != "auto":
            # What the command line names is the ground; the file's markers may lie in another frame.
            self.settings.setdefault("markers", [])
            self.settings["more_references"] = []

    def _shape(self, ground: str) -> dict[str, Any] | None:
        """Translate a reference object's shape, with `,height=H` or without, into settings; None if it is none."""
        kind, _, rest = ground.partition(":")
        if kind not in _SHAPES:
            return None
        lengths, _, height = rest.partition(",height=")
        option = f"--ground {kind}:{_SHAPES[kind]}"
        # The file's reference may have another shape; its box and method go on.
        shape: dict[str, Any] = dict.fromkeys(
            ("square_m", "rectangle_m", "regular_m", "sides_m", "diagonal_m", "corners_m", "height_m")
        )
        if kind == "polygon":
            pairs = max((lengths.count(",") + 2) // 2, 3)
            numbers = self._read(lengths, 2 * pairs, option)
            shape["corners_m"] = tuple(zip(numbers[::2], numbers[1::2], strict=True))
        elif kind == "square":
            shape["square_m"] = self._read(lengths, 1, option)[0]
        elif kind == "regular":
            sides, _, length = lengths.partition(",")
            shape["regular_m"] = (_numbers(sides, 1, option)[0], self._read(length, 1, option)[0])
        else:
            shape["rectangle_m"] = self._read(lengths, 2, option)
        if height:
            shape["height_m"] = self._read(height, 1, f"{option},height=H")[0]
        return shape

    def _marker(self, text: str) -> dict[str, Any]:
        """Read `marker:SIZE` or `marker:SIZE,id=ID` into settings of the only marker, which defines the site frame."""
        size, *words = text.removeprefix("marker:").split(",")
        marker: dict[str, Any] = {"size_m": self._read(size, 1, "--ground marker:SIZE")[0]}
        for word in words:
            name, _, value = word.strip().partition("=")
            if name != "id" or not value.isdecimal() or len(words) > 1:
                raise ConfigError(
                    expected="--ground marker:SIZE or marker:SIZE,id=ID",
                    found=repr(text),
                    fix="write for example marker:1.2,id=3",
                )
            marker["id"] = int(value)
        return {"markers": [marker], "survey": None, "reference": None}

    def _read(self, text: str, count: int, option: str) -> tuple[float, ...]:
        """Return lengths in metres, and remember how they were typed."""
        try:
            read = [TypedLength.read(part) for part in text.split(",")]
        except ValueError:
            read = []
        if len(read) != count:
            raise ConfigError(
                expected=f"{count} length{'s with commas' * (count > 1)} for {option}",
                found=repr(text),
                fix="write metres, or every length with its unit, as 2.89m, 9.5ft or 9'6\"",
            )
        self._lengths += read
        return tuple(one.length_m for one in read)


def _numbers(text: str, count: int, option: str) -> tuple[float, ...]:
    try:
        numbers = tuple(float(part) for part in text.split(","))
    except ValueError:
        numbers = ()
    if len(numbers) != count:
        raise ConfigError(
            expected=f"{count} number{'s with commas' * (count > 1)} for {option}",
            found=repr(text),
            fix=f"write for example {','.join(['10', '20', '30', '40'][:count])}",
        )
    return numbers
