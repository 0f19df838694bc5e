"""What is clicked becomes settings; what cannot be is refused in words."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from laws import examples

pytest.importorskip("fastapi", reason="the page's server needs the extra `serve`")

from standoff.config import settings_from
from standoff.core.errors import ConfigError
from standoff.service.setup.draft import (
    Draft,
    DraftFile,
    DraftStale,
    PointDraft,
    ReferenceDraft,
    ZoneDraft,
    corners_in_order,
    read_length_m,
)

SQUARE_PX = [(100.0, 300.0), (300.0, 310.0), (290.0, 120.0), (110.0, 100.0)]
"""Counter-clockwise as one sees it."""


def draft(**reference: object) -> Draft:
    return Draft(reference=ReferenceDraft.model_validate({"corners_px": SQUARE_PX, "lengths_m": [2.0], **reference}))


@examples(40)
@given(st.integers(0, 3), st.booleans())
def test_whichever_way_round_one_clicks_the_first_corner_stays_and_the_order_is_the_same(
    first: int, back: bool
) -> None:
    clicked = [SQUARE_PX[(first + (-k if back else k)) % 4] for k in range(4)]
    corners, is_turned = corners_in_order(clicked)
    np.testing.assert_array_equal(corners, [SQUARE_PX[(first + k) % 4] for k in range(4)])
    assert is_turned == back


@pytest.mark.parametrize(
    ("order", "said"),
    [((0, 2, 1, 3), "cross"), ((0, 1, 1, 2), "in a row")],
)
def test_corners_that_no_picture_of_a_top_has_are_refused_in_words(order: tuple[int, ...], said: str) -> None:
    with pytest.raises(ConfigError, match=said):
        draft(corners_px=[SQUARE_PX[k] for k in order]).settings(None, None)


def test_sides_go_with_the_corners_that_they_lie_between() -> None:
    lengths = [2.4, 2.6, 0.8, 2.5, 2.7]
    there = draft(shape="sides", lengths_m=lengths).settings(None, None)["ground"]["reference"]
    assert (there["sides_m"], there["diagonal_m"]) == (lengths[:4], 2.7)
    back = [SQUARE_PX[0], *reversed(SQUARE_PX[1:])]
    turned = draft(shape="sides", lengths_m=lengths, corners_px=back).settings(None, None)["ground"]["reference"]
    assert (turned["sides_m"], turned["diagonal_m"]) == ([2.5, 0.8, 2.6, 2.4], 2.7)
    rectangle = draft(shape="rectangle", lengths_m=[2.0, 3.0], corners_px=back).settings(None, None)
    assert rectangle["ground"]["reference"]["rectangle_m"] == [3.0, 2.0]


def test_what_it_says_are_valid_settings_with_all_corners_in_the_box() -> None:
    whole = draft(height_m=0.4, time_s=1.5)
    whole.zones = [ZoneDraft(name="pit", kind="no_go", ring_m=[(0, 0), (2, 0), (2, 2)])]
    whole.radius_m = {"excavator": 10.0}
    settings = settings_from({}, "the draft", whole.settings(None, Path("zones.geojson")))
    reference = settings.ground.reference
    assert reference is not None and reference.box_px is not None
    left, top, right, bottom = reference.box_px
    assert all(left < x < right and top < y < bottom for x, y in SQUARE_PX)
    assert (reference.square_m, reference.height_m, reference.box_time_s) == (2.0, 0.4, 1.5)
    assert settings.locate.radius_m["excavator"] == 10.0


def test_what_is_missing_is_named_before_there_can_be_metres() -> None:
    assert Draft().missing() == "corners: 4"
    assert draft(corners_px=SQUARE_PX[:3]).missing() == "corners: 1"
    assert draft(lengths_m=[None]).missing() == draft(shape="rectangle").missing() == "lengths"
    assert draft().missing() == Draft(ground="auto").missing() == ""
    survey = Draft(ground="survey")
    survey.survey.points = [PointDraft(name=f"p{k}", at_px=(k, k) if k else None, m=(k, k)) for k in range(4)]
    assert survey.missing() == "points: 1"


@pytest.mark.parametrize(
    ("text", "unit", "length_m"),
    [("2.89", "metres", 2.89), ("2,89 m", "feet", 2.89), ("10", "feet", 3.048), ("9'6\"", "metres", 2.8956)],
)
def test_lengths_are_read_as_the_label_or_the_text_says(text: str, unit: str, length_m: float) -> None:
    assert read_length_m(text, unit) == pytest.approx(length_m)  # type: ignore[arg-type]


@pytest.mark.parametrize("text", ["", "much", "2.8.9", "nan", "1e"])
def test_what_is_no_length_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="a length"):
        read_length_m(text, "metres")


def test_a_draft_outlives_the_page_and_two_pages_do_not_overwrite_each_other(tmp_path: Path) -> None:
    path = tmp_path / ".site.yaml.draft"
    first = DraftFile(path, Draft())
    revision = first.replace(draft(), 0)
    with pytest.raises(DraftStale):
        first.replace(Draft(), 0)
    again = DraftFile(path, Draft())
    assert (again.revision, again.draft) == (revision, draft())
    again.remove()
    again.remove()
    assert DraftFile(path, Draft()).draft == Draft()


@pytest.mark.parametrize(
    "content", ["", "[]", "{}", '{"revision": 1, "draft": {"ground": "magic"}}', '{"revision": "x"}']
)
def test_a_file_that_is_no_draft_is_refused_in_one_line(tmp_path: Path, content: str) -> None:
    path = tmp_path / ".site.yaml.draft"
    path.write_text(content)
    with pytest.raises(ConfigError, match="draft") as caught:
        DraftFile(path, Draft())
    assert "\n" not in str(caught.value)
