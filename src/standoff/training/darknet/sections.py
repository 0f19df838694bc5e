"""Read the text of a Darknet `.cfg`: sections, and in each its options.

Of an option that stands twice in a section the first counts: so does Darknet, which searches its list of them from the
front. Comments may be in any encoding; what counts is ASCII.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, Literal, cast, get_args

from standoff.core.errors import ModelError
from standoff.files.lfs import refuse_pointer
from standoff.files.plain_text import UnknownEncoding, decoded, read_text

Activation = Literal["linear", "leaky", "logistic", "relu", "relu6", "mish", "swish"]

_TRAINING_OPTIONS: Final = frozenset(
    {
        "beta_nms",
        "burnin_update",
        "cls_normalizer",
        "counters_per_class",
        "delta_normalizer",
        "focal_loss",
        "ignore_thresh",
        "iou_loss",
        "iou_normalizer",
        "iou_thresh",
        "iou_thresh_kind",
        "jitter",
        "label_smooth_eps",
        "learning_rate",
        "max",
        "max_delta",
        "nms_kind",
        "obj_normalizer",
        "objectness_smooth",
        "random",
        "resize",
        "show_details",
        "stopbackward",
        "train_only_bn",
        "truth_thresh",
    }
)
"""They steer training or Darknet's own post-processing; the network computes the same without them."""


@dataclass(slots=True)
class Section:
    """One section, and which of its options have been asked for.

    Attributes:
        name: Between the brackets.
        line: Of its head.
        source: The file, for messages.
        options: Value and line of each.
        read: Those that were asked for.
        warnings: Options that stand here twice with different values.
    """

    name: str
    line: int
    source: str
    options: dict[str, tuple[str, int]] = field(default_factory=dict)
    read: set[str] = field(default_factory=set)
    warnings: list[str] = field(default_factory=list)

    def add(self, key: str, value: str, line: int) -> None:
        """Take in an option; of two with one name the first counts."""
        first, first_line = self.options.setdefault(key, (value, line))
        if first != value:
            self.warnings.append(
                f"{self.source}, line {line}: '{key}' stands in [{self.name}] a second time; as in Darknet "
                f"{first or 'nothing'} of line {first_line} counts, not {value or 'nothing'}"
            )

    def error(self, expected: str, found: str, line: int | None = None) -> ModelError:
        """Return the error of an option, or of the section."""
        where = f"in [{self.name}] at line {line or self.line} of {self.source}"
        return ModelError(expected=f"{expected} {where}", found=found, fix="correct the cfg file")

    def word(self, key: str, default: str) -> tuple[str, int]:
        """Return an option's text and line."""
        self.read.add(key)
        return self.options.get(key, (default, self.line))

    def numbers(self, key: str, default: str = "") -> tuple[float, ...]:
        """Return the numbers of a list.

        Raises:
            ModelError: One of them is none, or not finite.
        """
        text, line = self.word(key, default)
        try:
            numbers = tuple(float(part) for part in text.split(",") if part)
        except ValueError:
            raise self.error(f"numbers for '{key}'", f"'{text}'", line) from None
        if any(abs(number) > _LARGEST for number in numbers) or any(number != number for number in numbers):
            raise self.error(f"numbers of at most {_LARGEST:g} for '{key}'", f"'{text}'", line)
        return numbers

    def number(self, key: str, default: float) -> float:
        """Return one number.

        Raises:
            ModelError: It is none.
        """
        numbers = self.numbers(key, repr(default))
        if len(numbers) != 1:
            raise self.error(f"one number for '{key}'", f"{len(numbers)}", self.word(key, "")[1])
        return numbers[0]

    def integers(self, key: str) -> tuple[int, ...]:
        """Return at least one whole number.

        Raises:
            ModelError: There is none, or one is not whole.
        """
        numbers = self.numbers(key)
        if not numbers or any(number != int(number) for number in numbers):
            text, line = self.word(key, "")
            raise self.error(f"whole numbers for '{key}'", f"'{text}'", line)
        return tuple(int(number) for number in numbers)

    def integer(self, key: str, default: int, *, at_least: int = 1) -> int:
        """Return one whole number.

        Raises:
            ModelError: It is none, or too small.
        """
        number = self.number(key, default)
        if number != int(number) or number < at_least:
            text, line = self.word(key, "")
            raise self.error(f"a whole number of at least {at_least} for '{key}'", f"'{text}'", line)
        return int(number)

    def activation(self, default: Activation) -> Activation:
        """Return the section's activation.

        Raises:
            ModelError: It is not understood.
        """
        name, line = self.word("activation", default)
        if name not in get_args(Activation):
            raise self.error(f"an activation of {', '.join(get_args(Activation))}", f"'{name}'", line)
        return cast(Activation, name)

    def refuse_unread(self) -> None:
        """Refuse options that nobody asked for and that may matter.

        Raises:
            ModelError: There is one.
        """
        for key in self.options.keys() - self.read - _TRAINING_OPTIONS:
            raise self.error("only options that standoff understands", f"'{key}'", self.options[key][1])


_LARGEST: Final = 1e6
"""Far above any width, anchor or number of filters."""


def read_sections(text: str, source: str) -> Iterator[Section]:
    r"""Take a cfg's text apart.

    Args:
        text: Of the file.
        source: The file, for messages.

    Raises:
        ModelError: A line is neither a section nor an option.

    >>> [section.name for section in read_sections("[net]\n[route]\nlayers=-1 # back", "a.cfg")]
    ['net', 'route']
    """
    section: Section | None = None
    # Not splitlines: what is an ellipsis in Windows-1252 ends a line in Latin-1.
    for line_number, raw in enumerate(text.split("\n"), start=1):
        line = "".join(raw.split("#")[0].split())
        if not line or line.startswith(";"):
            continue
        if line.startswith("["):
            if section is not None:
                yield section
            section = Section(line.strip("[]"), line_number, source)
            continue
        key, equals, value = line.partition("=")
        if section is None or not equals:
            raise ModelError(
                expected=f"a [section] or option=value at line {line_number} of {source}",
                found=f"'{line[:40]}'",
                fix="give a Darknet cfg file",
            )
        section.add(key, value, line_number)
    if section is not None:
        yield section


def read_cfg_text(path: Path) -> str:
    """Read the text of a cfg, whatever the encoding of its comments.

    Raises:
        ModelError: It cannot be read.
    """
    what = f"a Darknet cfg file at {path}"
    refuse_pointer(path, what, ModelError)
    try:
        content = path.read_bytes()
    except OSError as error:
        raise ModelError(expected=what, found=error.strerror or type(error).__name__, fix="check the path") from error
    try:
        return decoded(content)
    except UnknownEncoding as error:
        if not error.is_eight_bit:
            fix = "save the file as UTF-8, or check the path"
            raise ModelError(expected=what, found=str(error), fix=fix) from error
        # Every byte is a letter of Latin-1, so the text survives; whatever is not ASCII is no option of Darknet.
        return content.decode("latin-1")


def read_names_text(path: Path) -> str:
    """Read the text of a names file.

    Raises:
        ModelError: It cannot be read; names the encoding where it is not UTF-8.
    """
    refuse_pointer(path, f"a names file at {path}", ModelError)
    return read_text(path, "a names file", ModelError)
