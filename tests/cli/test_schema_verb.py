from __future__ import annotations

import json
from pathlib import Path

import pytest
from cli.calling import Call

from standoff.schemas import SCHEMAS


def test_without_a_name_the_names_are_told(call: Call) -> None:
    assert call("schema") == (0, "".join(f"{name}\n" for name in SCHEMAS), "")


@pytest.mark.parametrize("name", ["hazards", "tracks"])
def test_a_schema_is_printed(call: Call, name: str) -> None:
    code, printed, err = call("schema", name)
    assert (code, err) == (0, "")
    assert json.loads(printed) == SCHEMAS[name]()


def test_all_schemas_are_written_to_a_folder(call: Call, tmp_path: Path) -> None:
    assert call("schema", "--out", tmp_path / "new" / "schemas")[0] == 0
    written = {path.name: json.loads(path.read_text()) for path in (tmp_path / "new" / "schemas").iterdir()}
    assert written == {f"{name}.schema.json": make() for name, make in SCHEMAS.items()}


def test_an_output_that_has_none_is_refused_in_one_line(call: Call) -> None:
    code, printed, err = call("schema", "video")
    assert (code, printed, err.count("\n")) == (2, "", 1)
    assert f"expected an output, {', '.join(SCHEMAS)}, found video" in err
