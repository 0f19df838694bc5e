"""What a detector's ONNX file says about itself, written by the export and read by the detector.

The metadata of the file holds one text a key: `standoff_format`, and as JSON `classes`, `anchors_px`,
`input_size_px`, `preprocessing`, `output`, `sources` and, where it was measured, `finds_workers`. The graph
has one input, and one output or two:

- input `picture`: (1, 3, height, width) float32 or float16, RGB, 0 to 1, the picture letterboxed: scaled to fit without
  changing its aspect ratio, in the middle, the rest 0.5 as in Darknet;
- output `boxes`: (1, N, 5 + classes): centre x, y, width, height in input pixels, where 0 is the left or
  top edge of the first pixel; objectness; the probability of each class given an object;
- output `points`, of networks that have learnt it: (1, N, 4): where the middle of the thing's footprint appears, x and
  y, and their standard errors, in input pixels; NaN in rows of a joined network that has not.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final

from standoff.core.errors import ModelError
from standoff.core.finding import KEY as FINDS_WORKERS

FORMAT_KEY: Final = "standoff_format"
FORMAT: Final = "1"
PICTURE_INPUT: Final = "picture"
BOXES_OUTPUT: Final = "boxes"
POINTS_OUTPUT: Final = "points"
PREPROCESSING: Final = {"colour": "RGB", "divide_by": 255, "letterbox_grey": 0.5}
OUTPUT_COLUMNS: Final = ("centre_x_px", "centre_y_px", "width_px", "height_px", "objectness", "class probabilities")
_FIX: Final = "make the file with `standoff export`"


@dataclass(frozen=True, slots=True)
class ModelCard:
    """Facts about a detector.

    Attributes:
        classes: Labels in the order of the output's columns.
        anchors_px: For each head its anchors' (width, height) in input pixels.
        input_size_px: (width, height).
        sources: SHA-256 of each file that the model was made from, by file name.
        finds_workers: `height_px` of boxes in the input, rising, and the `share` of workers found at each; empty where
            nobody measured it.
    """

    classes: tuple[str, ...]
    anchors_px: tuple[tuple[tuple[float, float], ...], ...]
    input_size_px: tuple[int, int]
    sources: Mapping[str, str]
    finds_workers: Mapping[str, Sequence[float]] = field(default_factory=dict)

    def to_metadata(self) -> dict[str, str]:
        """Return the texts to put into the file's metadata."""
        fields = {
            "classes": self.classes,
            "anchors_px": self.anchors_px,
            "input_size_px": self.input_size_px,
            "preprocessing": PREPROCESSING,
            "output": OUTPUT_COLUMNS,
            "sources": dict(self.sources),
        }
        if self.finds_workers:
            fields[FINDS_WORKERS] = dict(self.finds_workers)
        return {FORMAT_KEY: FORMAT, **{key: json.dumps(value) for key, value in fields.items()}}

    @classmethod
    def from_metadata(cls, metadata: Mapping[str, str], name: str) -> ModelCard:
        """Read the card back.

        Args:
            metadata: The file's texts.
            name: The file, for messages.

        Raises:
            ModelError: There is no card, its format or preprocessing is another, or it cannot be read.

        >>> card = ModelCard(("worker",), (((4.0, 8.0),),), (64, 32), {})
        >>> ModelCard.from_metadata(card.to_metadata(), "m.onnx") == card
        True
        """
        if FORMAT_KEY not in metadata:
            raise ModelError(
                expected=f"a model exported by standoff at {name}",
                found="an ONNX file without its metadata",
                fix="give a file that `standoff export` or `standoff train` made; others can be run and compared, not "
                "changed",
            )
        if metadata[FORMAT_KEY] != FORMAT:
            found = f"format '{metadata[FORMAT_KEY]}'"
            raise ModelError(expected=f"model format {FORMAT} in {name}", found=found, fix=_FIX)
        try:
            return cls._from_fields({key: json.loads(metadata[key]) for key in _FIELDS if key in metadata}, name)
        except (AttributeError, KeyError, TypeError, ValueError) as error:
            raise ModelError(
                expected=f"readable model metadata in {name}", found=f"{type(error).__name__}: {error}", fix=_FIX
            ) from error

    @classmethod
    def _from_fields(cls, fields: dict[str, Any], name: str) -> ModelCard:
        if fields["preprocessing"] != PREPROCESSING:
            found = json.dumps(fields["preprocessing"])
            raise ModelError(expected=f"preprocessing {json.dumps(PREPROCESSING)} in {name}", found=found, fix=_FIX)
        width_px, height_px = (int(side) for side in fields["input_size_px"])
        return cls(
            classes=tuple(str(label) for label in fields["classes"]),
            anchors_px=tuple(tuple((float(w), float(h)) for w, h in head) for head in fields["anchors_px"]),
            input_size_px=(width_px, height_px),
            sources={str(key): str(value) for key, value in fields["sources"].items()},
            finds_workers=_rising(fields.get(FINDS_WORKERS, {})),
        )


_FIELDS: Final = ("classes", "anchors_px", "input_size_px", "preprocessing", "sources", FINDS_WORKERS)


def _rising(told: Mapping[str, Sequence[float]]) -> dict[str, tuple[float, ...]]:
    if not told:
        return {}
    heights, shares = (tuple(float(value) for value in told[key]) for key in ("height_px", "share"))
    if not 0 < len(heights) == len(shares) or list(heights) != sorted(set(heights)) or heights[0] <= 0.0:
        raise ValueError(f"{FINDS_WORKERS} whose heights do not rise, or whose shares are another number")
    if not all(0.0 <= share <= 1.0 for share in shares):
        raise ValueError(f"{FINDS_WORKERS} with shares outside 0 to 1")
    return {"height_px": heights, "share": shares}
