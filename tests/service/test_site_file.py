"""The settings file that is saved: what others wrote in it stays, and a run reads what was seen."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("fastapi", reason="the page's server needs the extra `serve`")

from service.test_draft import draft

from standoff.config import load_settings
from standoff.core.errors import ConfigError, StandoffError
from standoff.service.setup.draft import Draft, PointDraft, ZoneDraft
from standoff.service.setup.site_file import read_site, save_site

SIZE_PX = (640, 480)
BY_HAND = """\
# The yard behind the station.
detect_every: 2  # the drone is slow
ground:
  # measured on Monday
  reference:
    rectangle_m: [2.0, 3.0]
    height_m: 0.5
hazard: {buffer_m: 2.0}
"""


def test_a_new_file_says_what_the_draft_says(site_file: Path) -> None:
    assert save_site(site_file, draft(height_m=0.4), SIZE_PX) == [site_file]
    settings = load_settings(site_file)
    reference = settings.ground.reference
    assert reference is not None and (reference.square_m, reference.height_m) == (2.0, 0.4)
    assert not [path for path in site_file.parent.iterdir() if path != site_file]


def test_what_somebody_wrote_stays_comments_included_and_the_old_shape_goes(site_file: Path) -> None:
    site_file.write_text(BY_HAND)
    save_site(site_file, draft(height_m=0.4), SIZE_PX)
    text = site_file.read_text()
    assert all(words in text for words in ("# The yard behind", "# the drone is slow", "# measured on Monday"))
    settings = load_settings(site_file)
    assert (settings.detect_every, settings.hazard.buffer_m) == (2, 2.0)
    reference = settings.ground.reference
    assert reference is not None and (reference.square_m, reference.rectangle_m) == (2.0, None)


def test_saving_twice_changes_nothing(site_file: Path) -> None:
    site_file.write_text(BY_HAND)
    save_site(site_file, draft(), SIZE_PX)
    once = site_file.read_text()
    save_site(site_file, draft(), SIZE_PX)
    assert site_file.read_text() == once


def test_zones_and_surveyed_points_lie_beside_it_and_are_read(site_file: Path) -> None:
    whole = Draft(ground="survey", zones=[ZoneDraft(name="pit", kind="no_go", ring_m=[(0, 0), (2, 0), (2, 2)])])
    places = [(0.0, 0.0), (10.0, 0.0), (10.0, 10.0), (0.0, 10.0)]
    pixels = [(100.0, 400.0), (500.0, 400.0), (420.0, 100.0), (180.0, 100.0)]
    whole.survey.points = [
        PointDraft(name=f"p{k}", at_px=at, m=m) for k, (at, m) in enumerate(zip(pixels, places, strict=True))
    ]
    written = save_site(site_file, whole, SIZE_PX)
    assert [path.name for path in written] == ["site.yaml", "site-survey.yaml", "site-zones.geojson"]
    settings = load_settings(site_file)
    assert settings.ground.survey == written[1] and settings.zones == written[2]


def test_a_file_that_would_not_be_valid_is_left_as_it_is(site_file: Path) -> None:
    site_file.write_text("detect_evry: 3\n")
    with pytest.raises(ConfigError, match="detect_evry"):
        save_site(site_file, draft(), SIZE_PX)
    assert site_file.read_text() == "detect_evry: 3\n"


@pytest.mark.parametrize("content", ["- a list\n", "detect_evry: 3\n", "{\n"])
def test_a_site_that_is_no_settings_file_is_refused_before_the_page_opens(site_file: Path, content: str) -> None:
    site_file.write_text(content)
    with pytest.raises(StandoffError) as caught:
        read_site(site_file)
    assert "\n" not in str(caught.value)
