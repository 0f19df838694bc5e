"""What a run writes is what its schemas say, key by key and row by row."""

from __future__ import annotations

import json
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import jsonschema
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
import yaml
from cli.test_cli import make_video
from files.test_zone_file import collection, feature

from standoff.clips import RunFolder
from standoff.clips.reviews import REVIEW_FILE, VERDICTS, Review, add_review
from standoff.config import load_settings
from standoff.core.errors import DataError
from standoff.core.outputs import OUTPUTS, RECORD_FILE, RUN_FILES, SCHEMA_VERSION, ZONES_FILE
from standoff.monitor import RecordKeeper, open_run
from standoff.schemas import SCHEMAS

TABLES = ("tracks", "proximity", "frames", "detections")
FRAMES = 34
PIT = [[5.0, 5.0], [8.0, 5.0], [8.0, 7.0], [5.0, 7.0], [5.0, 5.0]]


@pytest.fixture(scope="module")
def run(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run two people and an excavator past a zone, with frames in which nothing is seen and others that rest."""
    folder = tmp_path_factory.mktemp("run")
    points = [{"name": f"{x},{y}", "px": [x, y], "m": [x / 20, (240 - y) / 20]} for x in (10, 300) for y in (60, 230)]
    (folder / "survey.yaml").write_text(yaml.safe_dump({"image_size_px": [320, 240], "points": points}))
    (folder / "plan.geojson").write_text(json.dumps(collection(feature("pit", "machine_only", coordinates=[PIT]))))
    return run_with(folder, {"ground": {"survey": "survey.yaml"}, "zones": "plan.geojson", "detect_every": 2})


@pytest.fixture(scope="module")
def unmapped(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Run the same without anything that says where the ground is, so that nothing can be measured."""
    return run_with(tmp_path_factory.mktemp("unmapped"), {"ground": {"auto": False}})


def run_with(folder: Path, settings: dict[str, Any]) -> Path:
    detector = {"detect": {"factory": "cli.test_replay:Unsure"}}
    settings = {**settings, "replace": detector, "outputs": [*TABLES, "hazards"]}
    (folder / "site.yaml").write_text(yaml.safe_dump(settings))
    opened = open_run(
        make_video(folder / "site.mp4", FRAMES), folder / "out", load_settings(folder / "site.yaml"), overlaps=False
    )
    for _ in opened:
        pass
    return folder / "out"


def check(name: str, value: Any) -> None:
    """Raise for a value that is not what its schema says, and for a key that the schema does not know."""
    schema = SCHEMAS[name]()
    jsonschema.Draft202012Validator(schema, format_checker=jsonschema.FormatChecker()).validate(value)
    assert value.keys() <= schema["properties"].keys()


def rows_of(run: Path, name: str) -> list[dict[str, Any]]:
    table = pq.read_table(run / OUTPUTS[name])
    times = [field.name for field in table.schema if pa.types.is_timestamp(field.type)]
    rows: list[dict[str, Any]] = table.to_pylist()
    return [{**row, **{time: row[time] and row[time].isoformat() for time in times}} for row in rows]


@pytest.mark.parametrize("name", SCHEMAS)
def test_every_schema_is_one(name: str) -> None:
    jsonschema.Draft202012Validator.check_schema(SCHEMAS[name]())


def test_every_file_of_a_run_that_programs_read_has_a_schema() -> None:
    for_people = {OUTPUTS["video"], OUTPUTS["report"]}
    titles = [schema()["title"] for schema in SCHEMAS.values()]
    described = {title.partition(",")[0] for title in titles if not title.endswith("one message")}
    assert described == {*RUN_FILES, REVIEW_FILE} - for_people


def test_what_people_say_of_a_hazard_is_what_its_schema_says(tmp_path: Path) -> None:
    for verdict in VERDICTS:
        add_review(tmp_path, Review("01M8", verdict, 2.5, "Ärger", datetime.now(UTC)))
    for line in (tmp_path / REVIEW_FILE).read_text(encoding="utf-8").splitlines():
        check("review", json.loads(line))


@pytest.mark.parametrize("name", TABLES)
def test_every_row_of_a_table_is_what_its_schema_says(run: Path, unmapped: Path, name: str) -> None:
    for rows in (rows_of(run, name), rows_of(unmapped, name)):
        assert len(rows) >= FRAMES / 2
        for row in rows:
            check(name, row)


@pytest.mark.parametrize("name", TABLES)
def test_a_table_says_what_its_columns_mean_as_its_schema_does(run: Path, name: str) -> None:
    schema = pq.read_schema(run / OUTPUTS[name])
    assert schema.metadata[b"schema_version"] == str(SCHEMA_VERSION).encode()
    said = SCHEMAS[name]()["properties"]
    assert [*said] == schema.names
    for field in schema:
        assert said[field.name]["description"] == field.metadata[b"description"].decode()
        assert said[field.name].get("unit", "") == field.metadata[b"unit"].decode()


def test_every_event_is_what_its_schema_says(run: Path, unmapped: Path) -> None:
    lines = [line for one in (run, unmapped) for line in (one / OUTPUTS["hazards"]).read_text().splitlines()]
    events = [json.loads(line) for line in lines]
    assert {event["rule"] for event in events} == {"proximity", "zone", "measurement"}
    for event in events:
        check("hazards", event)


def test_the_record_of_a_run_is_what_its_schema_says_while_it_goes_on_and_at_its_end(
    run: Path, unmapped: Path, tmp_path: Path
) -> None:
    for one in (run, unmapped):
        record = json.loads((one / RECORD_FILE).read_text())
        assert record["status"] == "complete"
        check("run", record)
    RecordKeeper(tmp_path, {})
    begun = json.loads((tmp_path / RECORD_FILE).read_text())
    assert begun["status"] == "running"
    check("run", begun)


@pytest.mark.parametrize("lost", ["counts", "settings", "stages", "watched_ground"])
def test_a_complete_record_that_lacks_something_is_none(run: Path, lost: str) -> None:
    record = json.loads((run / RECORD_FILE).read_text())
    del record[lost]
    with pytest.raises(jsonschema.ValidationError, match=lost):
        check("run", record)


def test_all_that_is_counted_has_a_meaning(run: Path) -> None:
    counted, said = (json.loads((run / RECORD_FILE).read_text())["counts"], SCHEMAS["run"]()["properties"]["counts"])
    assert counted.keys() == said["properties"].keys()
    assert all(one["description"] for one in said["properties"].values())


def test_the_zones_of_a_run_are_what_their_schema_says(run: Path) -> None:
    check("zones", json.loads((run / ZONES_FILE).read_text()))


@pytest.mark.parametrize(
    ("name", "key", "value"),
    [("tracks", "valid", None), ("tracks", "x_m", "3"), ("proximity", "measured", None), ("frames", "map", 1),
     ("detections", "detected", None), ("frames", "watched_cells", [0.5])],
)  # fmt: skip
def test_a_row_with_a_value_that_cannot_be_is_refused(run: Path, name: str, key: str, value: object) -> None:
    with pytest.raises(jsonschema.ValidationError):
        check(name, rows_of(run, name)[0] | {key: value})


@pytest.mark.parametrize("version", [SCHEMA_VERSION + 1, "2", None])
def test_a_run_of_a_newer_version_is_not_taken_for_one_of_this(tmp_path: Path, version: object) -> None:
    (tmp_path / RECORD_FILE).write_text(json.dumps({"status": "complete", "schema_version": version}))
    with pytest.raises(DataError, match="newer one"):
        RunFolder(tmp_path).record()
