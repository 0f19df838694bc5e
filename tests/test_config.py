from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from mutations import mutated

from standoff.config import Settings, build_ground, build_stage, load_settings, resolved
from standoff.core import protocols
from standoff.core.errors import ConfigError, GroundError
from standoff.core.types import Detections, Frame
from standoff.monitor import build_monitor
from standoff.stages.ground import FusedGround, ScaleWatch, Unmapped
from standoff.stages.hazard import HazardMonitor


class Blind(protocols.Detector):
    """A detector that sees nothing, to stand in for a model."""

    def __init__(self, patience: int = 0) -> None:
        self.patience = patience

    def detect(self, frame: Frame) -> Detections:
        return Detections.empty()


BLIND = {"replace": {"detect": {"factory": "test_config:Blind"}}}


def write(folder: Path, text: str) -> Path:
    path = folder / "site.yaml"
    path.write_text(text, encoding="utf-8")
    return path


def test_the_defaults_are_valid_and_survive_being_saved_and_read_again(tmp_path: Path) -> None:
    plain = resolved(load_settings())
    again = load_settings(write(tmp_path, yaml.safe_dump(plain)))
    assert resolved(again) == plain


def test_paths_in_a_settings_file_are_relative_to_the_file(tmp_path: Path) -> None:
    (tmp_path / "deep").mkdir()
    path = write(tmp_path / "deep", "model: net.onnx\nground: {survey: points.yaml, camera: /abs/camera.yaml}\n")
    settings = load_settings(path)
    assert settings.model == tmp_path / "deep" / "net.onnx"
    assert settings.ground.survey == tmp_path / "deep" / "points.yaml"
    assert settings.ground.camera == Path("/abs/camera.yaml")


def test_telemetry_is_a_file_beside_the_settings_or_none(tmp_path: Path) -> None:
    assert (
        load_settings(write(tmp_path, "source: {telemetry: flight.srt}\n")).source.telemetry == tmp_path / "flight.srt"
    )
    assert load_settings(write(tmp_path, "source: {telemetry: none}\n")).source.telemetry == "none"
    assert load_settings(None, {"source": {"telemetry": "none"}}).source.telemetry == "none"
    assert load_settings().source.telemetry is None


def test_the_command_line_wins_over_the_environment_and_that_over_the_file(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = write(
        tmp_path, "source: {every: 2}\ndetect_every: 2\ntrack: {max_coast_s: 3.0, max_lost_s: 3.0, confirm_hits: 5}\n"
    )
    monkeypatch.setenv("STANDOFF_DETECT_EVERY", "4")
    monkeypatch.setenv("STANDOFF_SOURCE__EVERY", "4")
    monkeypatch.setenv("STANDOFF_TRACK__MAX_COAST_S", "2.5")
    settings = load_settings(path, {"source": {"every": 6}})
    assert (settings.source.every, settings.detect_every) == (6, 4)
    assert (settings.track.max_coast_s, settings.track.confirm_hits) == (2.5, 5)


@pytest.mark.parametrize(
    ("text", "telling"),
    [
        ("detect_evry: 2\n", "did you mean detect_every?"),
        ("every: 2\n", "did you mean source.every?"),
        ("track: {max_cost_s: 2}\n", "did you mean max_coast_s?"),
        ("video: {draw: {circle: false}}\n", "video.draw has no setting 'circle'; did you mean circles?"),
        ("track: {high_score: 1.5}\n", "less than or equal to 1"),
        ("detect_every: true\n", "detect_every: true where a number should be"),
        ("ground: {reference: {square_m: 2, box_px: [true, 2, 30, 40]}}\n", "ground.reference.box_px: true where"),
        ("detect_every: 0\n", "greater than or equal to 1"),
        ("outputs: [video, film]\n", "film"),
        ("locate: {radius_m: {digger: 3}}\n", "no class is called digger"),
        ("ground: {reference: {}}\n", "give one of square_m"),
        ("ground: {reference: {square_m: 1, rectangle_m: [1, 2]}}\n", "square_m, rectangle_m"),
        ("ground: {reference: {sides_m: [1, 1, 1, 1]}}\n", "sides_m and diagonal_m go together"),
        ("ground: {reference: {corners_m: [[0, 0], [1, 0]]}}\n", "at least 3"),
        ("ground: {reference: {regular_m: [5.5, 1]}}\n", "integer"),
        ("- a\n- b\n", "list"),
        ("a: [\n", "YAML"),
        ("replace: {detect: {factory: nonsense}}\n", "factory"),
        ("extra_outputs: {record: {factory: 'a:b'}}\n", "record is the name of an output"),
    ],
)
def test_wrong_settings_are_one_line_that_says_where_and_what(tmp_path: Path, text: str, telling: str) -> None:
    with pytest.raises(ConfigError) as caught:
        load_settings(write(tmp_path, text))
    assert telling in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_settings_file_that_is_not_there_is_one_line(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        load_settings(tmp_path / "none.yaml")


def test_the_detector_is_the_shipped_one_unless_a_file_is_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    (tmp_path / "deep").mkdir()
    (tmp_path / "far").mkdir()
    assert load_settings().model == load_settings(overrides={"model": "site"}).model == "site"
    assert load_settings(write(tmp_path / "deep", "model: site\n")).model == "site"
    assert load_settings(overrides={"model": "./site"}).model == tmp_path / "site"
    assert load_settings(write(tmp_path / "far", "model: site.onnx\n")).model == tmp_path / "far" / "site.onnx"


def test_every_stage_can_be_replaced_by_name(tmp_path: Path) -> None:
    text = """
    replace:
      detect: {factory: "test_config:Blind", options: {patience: 7}}
      hazard: {factory: "standoff.stages.hazard:HazardMonitor"}
    """
    monitor = build_monitor(load_settings(write(tmp_path, text)))
    assert getattr(monitor.detector, "patience", None) == 7
    assert isinstance(monitor.hazard, HazardMonitor)


@pytest.mark.parametrize("factory", ["no_such_module:Thing", "test_config:NoSuchThing"])
def test_a_replacement_that_is_not_there_is_one_line(factory: str) -> None:
    settings = load_settings(overrides={"replace": {"detect": {"factory": factory}}})
    with pytest.raises(ConfigError, match="to be importable"):
        build_monitor(settings)


class Unfinished:
    """A stage that somebody has begun to write."""

    def detect(self, frame: Frame) -> Detections:
        return Detections.empty()


def test_a_replacement_that_lacks_a_method_is_one_line_that_names_it() -> None:
    settings = load_settings(overrides={"replace": {"detect": {"factory": "test_config:Unfinished"}}})
    with pytest.raises(ConfigError, match=r"a Detector, found Unfinished without describe, prepare, reset, rests"):
        build_monitor(settings)


def test_a_replacement_that_does_not_take_its_options_is_one_line() -> None:
    settings = load_settings(
        overrides={"replace": {"detect": {"factory": "test_config:Blind", "options": {"mood": 1}}}}
    )
    with pytest.raises(ConfigError, match="mood"):
        build_monitor(settings)


@pytest.mark.parametrize(
    "reference",
    [
        {"square_m": 2.89},
        {"rectangle_m": [2.0, 3.0]},
        {"sides_m": [3.0, 4.0, 3.0, 4.0], "diagonal_m": 5.0},
        {"corners_m": [[0, 0], [2, 0], [2.5, 2], [0, 1.5]]},
        {"corners_m": [[0, 0], [2, 0], [1.5, 2]]},
        {"regular_m": [8, 1.2]},
    ],
)
def test_a_reference_is_described_in_any_of_five_ways(reference: dict[str, object]) -> None:
    settings = load_settings(overrides={"ground": {"reference": reference}})
    assert isinstance(_inner(settings), FusedGround)


def test_a_shape_that_cannot_be_is_a_ground_error() -> None:
    settings = load_settings(overrides={"ground": {"reference": {"sides_m": [1.0, 1.0, 1.0, 1.0], "diagonal_m": 9.0}}})
    with pytest.raises(GroundError):
        build_ground(settings)


def _inner(settings: Settings) -> object:
    ground = build_ground(settings)
    assert isinstance(ground, ScaleWatch)
    return ground.inner


def test_more_references_and_markers_stand_beside_the_first_reference() -> None:
    several = {
        "reference": {"square_m": 2.0},
        "more_references": [{"square_m": 1.5}, {"corners_m": [[9, 0], [11, 0], [11, 2], [9, 2]]}],
        "markers": [{"size_m": 1.0, "x_m": 4.0, "y_m": 1.0}],
    }
    ground = build_ground(load_settings(overrides={"ground": several}))
    assert isinstance(ground, ScaleWatch)
    described = ground.describe()
    assert [one["place_known"] for one in described["references"]] == [True, False, True]
    assert described["markers"] == [0]


@pytest.mark.parametrize(
    "ground",
    [
        {"more_references": [{"square_m": 1.5}]},
        {"reference": {"square_m": 2.0}, "markers": [{"size_m": 1.0}]},
        {"reference": {"square_m": 2.0}, "more_references": [{"square_m": 1.5, "params": {"method": "paper"}}]},
    ],
    ids=["no first one", "a marker without a place", "two methods"],
)
def test_things_that_cannot_stand_beside_each_other_are_refused(ground: dict[str, object]) -> None:
    with pytest.raises(ConfigError):
        load_settings(overrides={"ground": ground})


def test_the_paper_s_method_reads_one_reference_and_nothing_else() -> None:
    one = {"square_m": 2.0, "params": {"method": "paper"}}
    for beside in ({"more_references": [one]}, {"markers": [{"size_m": 1.0, "x_m": 4.0, "y_m": 1.0}]}):
        with pytest.raises(ConfigError, match="does not read them"):
            build_ground(load_settings(overrides={"ground": {"reference": one, **beside}}))


def test_without_a_ground_there_is_one_by_what_the_source_tells() -> None:
    assert isinstance(_inner(Settings()), FusedGround)


def test_no_ground_at_all_has_to_be_asked_for() -> None:
    assert isinstance(build_ground(load_settings(overrides={"ground": {"auto": False}})), Unmapped)
    markers = {"auto": False, "markers": [{"size_m": 1.0}]}
    assert isinstance(_inner(load_settings(overrides={"ground": markers})), FusedGround)


@pytest.mark.parametrize("example", ["paper.yaml", "pets2009/site.yaml"])
def test_the_settings_among_the_examples_can_be_used(example: str) -> None:
    settings = load_settings(Path(__file__).parents[1] / "examples" / example)
    assert not isinstance(build_ground(settings), Unmapped)


class PeopleOnly(Blind):
    """A model that knows people only."""

    def describe(self) -> Mapping[str, Any]:
        return {"class_map": {"person": "worker"}}


def people_only(**more: object) -> Settings:
    return load_settings(overrides={"replace": {"detect": {"factory": "test_config:PeopleOnly"}}, **more})


def test_a_model_that_can_never_see_one_side_of_a_pair_is_refused() -> None:
    with pytest.raises(ConfigError, match="without any equipment"):
        build_monitor(people_only())
    build_monitor(people_only(proximity={"pairs": [["person", "person"]]}))


def test_a_reference_without_a_box_needs_a_model_that_knows_it() -> None:
    pairs = {"pairs": [["person", "person"]]}
    with pytest.raises(ConfigError, match="neither a box nor a model"):
        build_monitor(people_only(proximity=pairs, ground={"reference": {"square_m": 2.0}}))
    boxed = {"reference": {"square_m": 2.0, "box_px": [1, 2, 30, 40]}}
    build_monitor(people_only(proximity=pairs, ground=boxed))


@pytest.mark.parametrize(
    ("variable", "nearest"),
    [
        ("STANDOFF_DETECT_EVRY", "STANDOFF_DETECT_EVERY"),
        ("STANDOFF_TRAK__MAX_COAST_S", "STANDOFF_TRACK__MAX_COAST_S"),
        ("STANDOFF_MODELL", "STANDOFF_MODEL"),
        ("standoff_modell", "STANDOFF_MODEL"),
        ("STANDOF_SOURCE__EVERY", "STANDOFF_SOURCE__EVERY"),
        ("STANDOFFMODEL", "STANDOFF_MODEL"),
        ("StandOff_Modl", "STANDOFF_MODEL"),
        ("STANDOFF_DETECTEVERY", "STANDOFF_DETECT_EVERY"),
        ("STANDOFF_TRACK_MAX_COAST_S", "STANDOFF_TRACK__MAX_COAST_S"),
        ("STNADOFF_TRACK__MAX_COAST_S", "STANDOFF_TRACK__MAX_COAST_S"),
        ("STANDOFF_CONFIG", "--config"),
    ],
)
def test_a_misspelt_variable_is_refused_with_the_nearest_name(
    monkeypatch: pytest.MonkeyPatch, variable: str, nearest: str
) -> None:
    monkeypatch.setenv(variable, "4")
    with pytest.raises(ConfigError) as caught:
        load_settings()
    assert f"found {variable}." in str(caught.value) and nearest in str(caught.value)


def test_a_variable_that_is_like_no_setting_is_refused_without_a_guess(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("STANDOFF_CONFIG", "site.yaml")
    with pytest.raises(ConfigError) as caught:
        load_settings()
    assert "STANDOFF_FPS" not in str(caught.value)


@pytest.mark.parametrize(
    "variable", ["STAN_NUM_THREADS", "EVERY", "MODEL", "STANDBY_EVERY", "HANDOFF_EVERY", "OFFEVERY"]
)
def test_variables_of_other_programs_are_theirs(monkeypatch: pytest.MonkeyPatch, variable: str) -> None:
    monkeypatch.setenv(variable, "4")
    assert load_settings().source.every == 1


@pytest.mark.parametrize("variable", ["standoff_source__every", "STANDOFF_SOURCE__EVERY"])
def test_variables_are_read_in_any_case(monkeypatch: pytest.MonkeyPatch, variable: str) -> None:
    monkeypatch.setenv(variable, "4")
    assert load_settings().source.every == 4


def test_a_settings_file_with_a_name_twice_is_refused_with_both_lines(tmp_path: Path) -> None:
    with pytest.raises(ConfigError, match=r"line 3: the key `detect_every` a second time, after line 1"):
        load_settings(write(tmp_path, "detect_every: 2\nmodel: site\ndetect_every: 3\n"))


def test_numbers_in_a_settings_file_are_what_they_say_or_refused(tmp_path: Path) -> None:
    assert load_settings(write(tmp_path, "track: {max_lost_s: 1e1}\n")).track.max_lost_s == 10.0
    with pytest.raises(ConfigError, match="max_lost_s"):
        load_settings(write(tmp_path, "track: {max_lost_s: 12:30}\n"))


def test_a_settings_file_of_another_editor_is_read_or_its_encoding_named(tmp_path: Path) -> None:
    path = tmp_path / "site.yaml"
    path.write_bytes(b"\xef\xbb\xbfdetect_every: 2\r\n")
    assert load_settings(path).detect_every == 2
    path.write_bytes("detect_every: 2\n".encode("utf-16"))
    with pytest.raises(ConfigError, match="UTF-16"):
        load_settings(path)


_FILE = b"""detect_every: 2
model: site
ground:
  camera: camera.yaml
  reference: {corners_m: [[0, 0], [2.9, 0], [2.9, 2.9], [0, 2.9]], height_m: 0.4, box_px: [546, 386, 691, 510]}
track: {max_coast_s: 3.0, confirm_hits: 5}
proximity: {pairs: [[worker, excavator]]}
"""


@given(mutated(st.just(_FILE)))
def test_a_damaged_settings_file_is_settings_or_one_line(content: bytes) -> None:
    with TemporaryDirectory() as folder:
        path = Path(folder) / "site.yaml"
        path.write_bytes(content)
        try:
            load_settings(path)
        except ConfigError as error:
            assert "\n" not in str(error)


def test_the_survey_s_own_camera_removes_the_lens_from_the_motion_too(tmp_path: Path) -> None:
    size = "width_px: 640\nheight_px: 480\n"
    (tmp_path / "camera.yaml").write_text(size + "fx: 300\nfy: 300\ncx: 320\ncy: 240\nlens: fisheye\nk1: -0.02\n")
    points = "".join(f"- {{px: [{x}, {y}], m: [{x / 50}, {-y / 40}]}}\n" for x in (100, 500) for y in (100, 400))
    (tmp_path / "survey.yaml").write_text(f"image_size_px: [640, 480]\ncamera: camera.yaml\npoints:\n{points}")
    settings = load_settings(write(tmp_path, "ground: {survey: survey.yaml}\n"))
    assert build_stage("motion", settings).describe()["lens_distortion_removed"]
