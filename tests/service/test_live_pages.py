"""The pages as people meet them, in a real browser."""

from __future__ import annotations

import json
import re
import shutil
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from statistics import median
from typing import Any

import av
import numpy as np
import pytest
from cli.conftest import write_site
from cli.test_cli import make_video
from cli.test_replay import TABLES, monitor
from laws import seeds
from service.browser import BUILT, Browser, browsing, needs_browser, served, told
from service.demo_film import CLICK_PX, DEMO, HEIGHT_M, SIDE_M

from standoff.config import load_settings
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff.files.zone_file import read_zones
from standoff.monitor import open_run

pytestmark = pytest.mark.live
FILM_VIEW = "document.querySelector('review-page')?.shadowRoot.querySelector('film-view')"
PICTURE = "picture-view svg.picture"
WIDTH_PX, HEIGHT_PX = 1920, 1080
SHOWN_RADIUS = (
    "[...document.querySelector('setup-page').shadowRoot.querySelector('radii-panel').shadowRoot"
    ".querySelectorAll('length-field')].some((one) => one.shadowRoot.querySelector('input').value === '{text}')"
)
TOO_WIDE = """() => {
  const found = [];
  const look = (root) => root.querySelectorAll("*").forEach((one) => {
    const { right, width } = one.getBoundingClientRect();
    const sticksOut = width && right > document.documentElement.clientWidth + 1;
    if (sticksOut && !one.closest("svg *, ol")) found.push(one.localName);
    if (one.shadowRoot) look(one.shadowRoot);
  });
  if (document.documentElement.scrollWidth > document.documentElement.clientWidth) look(document);
  return found;
}"""
"""What sticks out of the page to the right, where the page can be scrolled there."""
LOOKS: tuple[dict[str, Any], ...] = (
    {"locale": "en", "color_scheme": "light"},
    {"locale": "de", "color_scheme": "dark"},
    {"locale": "de", "viewport": {"width": 420, "height": 900}},
)


@pytest.fixture(autouse=True)
def _there_is_a_browser() -> None:
    needs_browser()


def click_reference(browser: Browser, corners_px: FloatArray, rng: np.random.Generator) -> None:
    """Four clicks, side and height: what a person does, with a hand that is off by CLICK_PX."""
    for corner in (corners_px + rng.normal(0.0, CLICK_PX, corners_px.shape)).tolist():
        browser.picture_click(PICTURE, tuple(corner), WIDTH_PX)
        browser.page.wait_for_timeout(250)
    for name, length_m in (("side", SIDE_M), ("height", HEIGHT_M)):
        browser.page.fill(f"input[name={name}]", str(length_m))
        browser.page.keyboard.press("Enter")
    browser.page.wait_for_selector("result-panel .good")


def ten_metres_px(view: View, corners_px: FloatArray, rng: np.random.Generator) -> FloatArray:
    """Return the ends, in the picture, of ten metres on the ground, from the reference's middle in some direction."""
    while True:
        turn = rng.uniform(0.0, 2.0 * np.pi)
        along = np.array([np.cos(turn), np.sin(turn)])
        begin_m = view.to_plane(corners_px.mean(axis=0)[None])[0]
        ends_px = view.project(np.column_stack([[begin_m, begin_m + 10.0 * along], np.zeros(2)]))
        if ((ends_px > 40.0) & (ends_px < np.array([WIDTH_PX, HEIGHT_PX]) - 40.0)).all():
            return ends_px


def tape(browser: Browser, ends_px: FloatArray) -> float:
    """Lay the tape; return its length as the page was told it, in metres."""
    browser.page.click("button[data-tool=tape]")
    browser.picture_click(PICTURE, tuple(ends_px[0].tolist()), WIDTH_PX)
    with browser.page.expect_response("**/api/tape") as told:
        browser.picture_click(PICTURE, tuple(ends_px[1].tolist()), WIDTH_PX)
    answer = told.value.json()
    browser.page.wait_for_selector("#tape")
    assert browser.page.inner_text("#tape") == answer["text"]
    return float(answer["length_m"])


@pytest.mark.parametrize("seed", seeds(2))
def test_four_clicks_give_metres_and_what_is_saved_runs(
    seed: int, corners_px: FloatArray, view: View, tmp_path: Path
) -> None:
    rng, site = np.random.default_rng(seed), tmp_path / "site.yaml"
    ends_px = ten_metres_px(view, corners_px, rng)
    with served("setup", DEMO / "video.mp4", "--config", site) as (address, process), browsing() as browser:
        began_s = time.monotonic()
        browser.page.goto(address)
        browser.page.wait_for_selector(f"{PICTURE} image")
        told(f"usable after {time.monotonic() - began_s:.2f} s")
        click_reference(browser, corners_px, rng)
        length_m = tape(browser, ends_px)
        told(f"10 m are {length_m:.2f} m after 4 clicks on the reference and 2 of the tape")
        assert length_m == pytest.approx(10.0, rel=0.02)
        browser.page.click("#save")
        browser.page.wait_for_selector("save-panel code")
        assert "standoff run" in browser.page.inner_text("save-panel code")
        browser.page.close()
        assert process.wait(30) == 0, "the server ends with its page"
        assert browser.complaints == []
    nobody = {"factory": "standoff.testing:ScriptedDetector", "options": {"script": {}}}
    settings = load_settings(site, {"replace": {"detect": nobody}, "outputs": ["hazards"]})
    ground: Any = next(iter(open_run(DEMO / "video.mp4", tmp_path / "out", settings))).ground
    places_m, _ = ground.to_ground(ends_px)
    assert np.linalg.norm(places_m[1] - places_m[0]) == pytest.approx(length_m, abs=0.05)


def test_a_page_that_is_closed_half_way_loses_nothing_and_two_pages_do_not_overwrite_each_other(
    corners_px: FloatArray, tmp_path: Path
) -> None:
    words = ("setup", DEMO / "video.mp4", "--config", tmp_path / "site.yaml")
    with served(*words) as (address, process), browsing() as browser:
        page = browser.page
        page.goto(address)
        page.wait_for_selector(f"{PICTURE} image")
        other = page.context.new_page()
        other.goto(address.partition("?")[0])
        other.wait_for_selector(f"{PICTURE} image")
        for corner in corners_px[:2].tolist():
            browser.picture_click(PICTURE, tuple(corner), WIDTH_PX)
            page.wait_for_timeout(600)
        other.fill("input[name=side]", "3")
        other.keyboard.press("Enter")
        other.wait_for_selector(".notice button")
        other.click(".notice button")
        other.wait_for_selector("picture-view [data-grip=corner-1]")
        page.context.close()
        assert process.wait(30) == 0
    with served(*words) as (address, _), browsing() as browser:
        browser.page.goto(address)
        browser.page.wait_for_selector("picture-view [data-grip=corner-1]")
        assert browser.page.locator("picture-view [data-grip]").count() == 2


def test_a_corner_is_dragged_and_moved_by_keys_and_the_answer_follows(corners_px: FloatArray, tmp_path: Path) -> None:
    words = ("setup", DEMO / "video.mp4", "--config", tmp_path / "site.yaml")
    with served(*words) as (address, _), browsing() as browser:
        page = browser.page
        page.goto(address)
        page.wait_for_selector(f"{PICTURE} image")
        click_reference(browser, corners_px, np.random.default_rng(1))
        page.wait_for_timeout(1500)
        grip = page.locator("[data-grip=corner-0]")
        before = float(grip.get_attribute("cx"))
        grip.focus()
        page.keyboard.press("ArrowRight")
        page.keyboard.press("Shift+ArrowRight")
        assert float(grip.get_attribute("cx")) == pytest.approx(before + 1.1, abs=0.01)
        took_ms: list[float] = []

        def finished(request: Any) -> None:
            if "/api/ground" in request.url:
                took_ms.append(request.timing["responseEnd"])

        page.on("requestfinished", finished)
        box = grip.bounding_box()
        page.mouse.move(box["x"] + box["width"] / 2, box["y"] + box["height"] / 2)
        page.mouse.down()
        for step in range(30):
            page.mouse.move(box["x"] + box["width"] / 2 + step * 0.5, box["y"] + box["height"] / 2)
            page.wait_for_timeout(50)
        page.mouse.up()
        page.wait_for_timeout(1500)
        told(f"a dragged corner is answered in {median(took_ms):.0f} ms, {len(took_ms)} answers")
        assert len(took_ms) >= 5


@pytest.fixture
def short_film(tmp_path: Path) -> Path:
    """The demo's first second, which a trial runs in some."""
    path = tmp_path / "short.mp4"
    with av.open(str(DEMO / "video.mp4")) as whole, av.open(str(path), "w") as short:
        stream = short.add_stream_from_template(whole.streams.video[0])
        for packet in whole.demux(video=0):
            if packet.dts is not None and packet.dts * packet.time_base < 1.0:
                packet.stream = stream
                short.mux(packet)
    return path


def test_points_zones_and_circles_are_set_and_a_trial_runs(short_film: Path, view: View, tmp_path: Path) -> None:
    pixels = np.array([[300.0, 900.0], [1500.0, 950.0], [1300.0, 300.0], [500.0, 350.0]])
    places = view.to_plane(pixels)
    site = tmp_path / "site.yaml"
    with served("setup", short_film, "--config", site) as (address, _), browsing() as browser:
        page = browser.page
        page.goto(address)
        page.wait_for_selector(f"{PICTURE} image")
        page.check("input[value=survey]")
        page.fill("textarea[name=points]", "\n".join(f"p{k}\t{x:.3f}\t{y:.3f}" for k, (x, y) in enumerate(places)))
        page.click("basis-panel button")
        for point in pixels.tolist():
            browser.picture_click(PICTURE, tuple(point), WIDTH_PX)
            page.wait_for_timeout(300)
        page.wait_for_selector("result-panel .good")
        page.click("button[data-tool=zone]")
        for corner in ((1250, 820), (1600, 800), (1650, 980), (1280, 1000), (1250, 820)):
            browser.picture_click(PICTURE, corner, WIDTH_PX)
            page.wait_for_timeout(150)
        page.wait_for_selector("input[name=zone-name]")
        page.select_option("select[name=zone-kind]", "machine_only")
        page.click("radii-panel summary")
        page.fill("input[name=excavator]", "10")
        page.keyboard.press("Enter")
        page.wait_for_function("() => " + SHOWN_RADIUS.format(text="10 m"))
        page.select_option("select[name=unit]", "feet")
        page.wait_for_function("() => " + SHOWN_RADIUS.format(text="32.81 ft"))
        page.wait_for_selector("result-panel .good")
        page.click("#trial")
        page.wait_for_selector("trial-panel video")
        assert re.search(r"[1-9]\d* of \d+ pictures have metres", page.locator("trial-panel p").first.inner_text())
        page.click("#save")
        page.wait_for_selector("save-panel code")
        assert browser.complaints == []
    settings = load_settings(site)
    assert settings.ground.survey == tmp_path / "site-survey.yaml" and settings.zones == tmp_path / "site-zones.geojson"
    assert (settings.locate.radius_m["excavator"], settings.show.unit) == (10.0, "feet")
    (zone,) = read_zones(tmp_path / "site-zones.geojson")
    drawn = view.to_plane(np.array([[1250.0, 820.0], [1600.0, 800.0], [1650.0, 980.0], [1280.0, 1000.0]]))
    assert zone.kind == "machine_only"
    away = np.linalg.norm(zone.rings_m[0][:, None] - drawn[None], axis=2).min(axis=0)
    # These points lie on nothing: a click snaps to the corner of edges that is nearest, up to 7 px away.
    assert away.max() < 0.5


@pytest.mark.parametrize("look", LOOKS, ids=lambda look: "-".join(str(one) for one in look.values()))
def test_both_pages_can_be_used_by_everybody(
    look: dict[str, Any], corners_px: FloatArray, run: Path, tmp_path: Path
) -> None:
    with (
        served("setup", DEMO / "video.mp4", "--config", tmp_path / "site.yaml") as (address, _),
        browsing(**look) as browser,
    ):
        browser.page.goto(address)
        browser.page.wait_for_selector(f"{PICTURE} image")
        click_reference(browser, corners_px, np.random.default_rng(2))
        browser.page.click("radii-panel summary")
        assert browser.grave_findings() == []
        assert browser.page.evaluate("document.documentElement.lang") == look["locale"]
        assert browser.page.evaluate(TOO_WIDE) == []
    with served("open", run) as (address, _), browsing(**look) as browser:
        browser.page.goto(address)
        browser.page.click("hazard-list li button")
        browser.page.wait_for_selector("hazard-list fieldset")
        browser.page.wait_for_timeout(800)
        assert browser.grave_findings() == []
        assert browser.page.evaluate("document.documentElement.lang") == look["locale"]
        assert browser.page.evaluate(TOO_WIDE) == []


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A run of a film that no browser plays, which is then shown picture by picture."""
    folder = tmp_path_factory.mktemp("recorded")
    return monitor(make_video(folder / "site.mp4", 34), write_site(folder), folder / "out")


@pytest.fixture
def run(recorded: Path, tmp_path: Path) -> Iterator[Path]:
    shutil.copytree(recorded.parent, tmp_path / "mine")
    yield tmp_path / "mine" / recorded.name


@pytest.fixture
def played(corners_px: FloatArray, tmp_path: Path) -> Path:
    """A run of a film that browsers play."""
    approach = {"factory": "cli.test_cli:Approach"}
    corners = [[0.0, 0.0], [SIDE_M, 0.0], [SIDE_M, SIDE_M], [0.0, SIDE_M]]
    points = [{"name": f"p{k}", "px": corners_px[k].tolist(), "m": corners[k]} for k in range(4)]
    (tmp_path / "survey.json").write_text(json.dumps({"image_size_px": [1920, 1080], "points": points}))
    settings = load_settings(
        None,
        {
            "replace": {"detect": approach},
            "ground": {"survey": str(tmp_path / "survey.json")},
            "outputs": [*TABLES, "hazards"],
            "source": {"stop_s": 2.0},
        },
    )
    for _ in open_run(DEMO / "video.mp4", tmp_path / "out", settings):
        pass
    return tmp_path / "out"


def test_a_hazard_is_jumped_to_and_judged(run: Path) -> None:
    with served("open", run) as (address, process), browsing() as browser:
        page = browser.page
        page.goto(address)
        page.wait_for_selector("run-curves canvas")
        danger = page.locator("hazard-list li button", has_text="danger")
        danger.click()
        page.wait_for_selector("film-view svg polyline")
        page.wait_for_selector("film-view img[src^=blob]")
        assert "Worker 1" in page.locator("film-view svg").text_content()
        assert "danger" in page.locator("film-view svg").text_content()
        page.check("input[value=false_alarm]")
        page.fill("textarea[name=comment]", "a sign")
        page.keyboard.press("Tab")
        page.wait_for_function(f"() => {FILM_VIEW}.view.chosen.comment")
        page.check("input[name=unjudged]")
        assert page.locator("hazard-list li").count() == len(
            json.loads((run / "run.json").read_text())["counts"]["hazards"]
        )
        page.uncheck("input[name=danger]")
        assert page.locator("hazard-list li button", has_text="danger").count() == 0
        page.click("#play")
        page.wait_for_timeout(1500)
        page.close()
        assert process.wait(30) == 0
        # That the browser cannot play the film it says itself.
        assert [one for one in browser.complaints if "media" not in one.lower()] == []
    (first, last) = (json.loads(line) for line in (run / "review.jsonl").read_text().splitlines())
    assert (first["verdict"], last["verdict"], last["comment"]) == ("false_alarm", "false_alarm", "a sign")


def test_a_film_plays_and_the_overlays_go_with_it(played: Path) -> None:
    with served("open", played, "--film", DEMO / "video.mp4") as (address, _), browsing() as browser:
        page = browser.page
        page.goto(address)
        page.wait_for_function(f"() => {FILM_VIEW}?.shadowRoot.querySelector('video')?.readyState > 2")
        page.click("#play")
        page.wait_for_timeout(1200)
        page.click("#play")
        page.wait_for_timeout(500)
        shown_s, film_s = page.evaluate(
            f"() => [{FILM_VIEW}.view.timeS, {FILM_VIEW}.shadowRoot.querySelector('video').currentTime]"
        )
        assert shown_s > 0.2 and film_s == pytest.approx(shown_s, abs=0.06)
        assert page.locator("film-view svg rect").count() >= 1
        assert browser.complaints == []


def test_a_port_that_is_taken_is_said_in_one_line(tmp_path: Path, run: Path) -> None:
    with served("open", run) as (address, _):
        port = re.search(r":(\d+)/", address)[1]  # type: ignore[index]
        with pytest.raises(AssertionError) as caught, served("open", run, "--port", port):
            pass
        said = str(caught.value).split("\n")[0]
        assert said.startswith("standoff: expected a free port") and "--port" in said


def test_the_page_is_small() -> None:
    """Compressed, both pages together."""
    packed = subprocess.run(["gzip", "-c", *BUILT.glob("*.js")], capture_output=True, check=True).stdout
    told(f"{len(packed) / 1000:.0f} kB")
    assert len(packed) < 250_000
