"""`review.jsonl`: what people say of a run's hazards. Lines are only ever added; the last one of a hazard counts."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import asdict, dataclass, fields
from datetime import UTC, datetime
from pathlib import Path
from typing import Final, Literal, get_args

from standoff.core.errors import DataError, OutputError
from standoff.files.json_text import json_line, parse_json
from standoff.files.plain_text import read_text

REVIEW_FILE: Final = "review.jsonl"
"""In the folder of the run."""

Verdict = Literal["right", "false_alarm", "unsure", "open"]
VERDICTS: Final = get_args(Verdict)


@dataclass(frozen=True, slots=True)
class Review:
    """What somebody says of a hazard.

    Attributes:
        hazard_id: Of the hazard.
        verdict: "right", "false_alarm", or "unsure"; "open": taken back.
        time_s: When in the film the hazard was at its worst; the picture of it is there.
        comment: Anything; may be empty.
        reviewed_at: When it was said, UTC.
    """

    hazard_id: str
    verdict: Verdict
    time_s: float
    comment: str = ""
    reviewed_at: datetime | None = None


def read_reviews(folder: Path) -> Mapping[str, Review]:
    """Return what is said of the hazards of a run, by their ids; nothing where nobody has said anything.

    Args:
        folder: Of the run.

    Raises:
        DataError: The file holds something else.
    """
    path = folder / REVIEW_FILE
    if not path.is_file():
        return {}
    reviews: dict[str, Review] = {}
    for number, line in enumerate(filter(None, read_text(path, "reviews of a run", DataError).split("\n")), start=1):
        where = f"{path}, line {number}"
        review = _review(parse_json(line, "a review", where), where)
        reviews[review.hazard_id] = review
    return reviews


def add_review(folder: Path, review: Review) -> None:
    """Add what somebody says of a hazard to a run's reviews.

    Raises:
        OutputError: It cannot be written.
    """
    path = folder / REVIEW_FILE
    try:
        with path.open("a", encoding="utf-8") as file:
            file.write(json_line(asdict(review)))
    except OSError as error:
        raise OutputError(
            expected=f"a place to write {path}", found=error.strerror or str(error), fix="make room, or allow it"
        ) from error


def _review(told: object, where: str) -> Review:
    names = {field.name for field in fields(Review)}
    try:
        if not isinstance(told, dict) or not {"hazard_id", "verdict", "time_s"} <= told.keys() <= names:
            raise ValueError("other names")
        if told["verdict"] not in VERDICTS:
            raise ValueError(f"verdict {told['verdict']!r}")
        said_at = told.get("reviewed_at")
        return Review(
            str(told["hazard_id"]),
            told["verdict"],
            float(told["time_s"]),
            str(told.get("comment", "")),
            None if said_at is None else datetime.fromisoformat(said_at).astimezone(UTC),
        )
    except (TypeError, ValueError) as error:
        raise DataError(
            expected="a review, as `standoff open` writes it", found=f"{error} in {where}", fix="correct or remove it"
        ) from error
