"""What other people's editors and programs make of text, YAML and JSON."""

from __future__ import annotations

import json
from pathlib import Path

import pytest
import yaml
from hypothesis import given
from hypothesis import strategies as st
from laws import examples
from mutations import mutated

from standoff.core.errors import ConfigError, DataError
from standoff.files.json_text import parse_json, read_json
from standoff.files.plain_text import read_text
from standoff.files.yaml_text import dump_yaml, parse_yaml, read_yaml, write_yaml

_SETTINGS = b"""model: site
ground: &ground
  reference: {shape: square, side_m: 2.89, box_px: [546, 386, 691, 510]}
names: [person, "no", 'x y']
again: *ground
more:
  <<: *ground
  lr: 1.5e-3
"""


def one_line(text: str) -> str:
    with pytest.raises(ConfigError) as caught:
        parse_yaml(text, "settings", "site.yaml", ConfigError)
    assert "\n" not in str(caught.value)
    return str(caught.value)


@pytest.mark.parametrize("content", [b"\xef\xbb\xbfperson\r\nhelmet\r\n", b"person\nhelmet\n", b"person\rhelmet\r"])
def test_a_byte_order_mark_and_line_ends_are_no_part_of_a_text(tmp_path: Path, content: bytes) -> None:
    (tmp_path / "classes.txt").write_bytes(content)
    assert read_text(tmp_path / "classes.txt", "labels").splitlines() == ["person", "helmet"]


@pytest.mark.parametrize(
    ("content", "encoding"),
    [
        ("größe: 1\n".encode("cp1252"), "Windows-1252"),
        ("person\n".encode("utf-16"), "UTF-16"),
        ("person\n".encode("utf-16-be"), "UTF-16"),
        ("person\nhelmet\n".encode("utf-16-le"), "UTF-16"),
        ("person\n".encode("utf-32"), "UTF-32"),
        (b"\x89PNG\r\n\x1a\n\x00\x00\x00\rIHDR", "a binary file"),
        (b"person\x00helmet\n", "a binary file"),
    ],
)
def test_what_is_not_utf8_is_named(tmp_path: Path, content: bytes, encoding: str) -> None:
    (tmp_path / "a.txt").write_bytes(content)
    with pytest.raises(DataError, match=f"found {encoding}.*UTF-8 text"):
        read_text(tmp_path / "a.txt", "labels")


def test_a_folder_and_nothing_at_all_are_no_texts(tmp_path: Path) -> None:
    with pytest.raises(DataError, match="no such file"):
        read_text(tmp_path / "missing", "labels")
    with pytest.raises(DataError, match="labels at"):
        read_text(tmp_path, "labels")


def test_only_true_and_false_are_booleans_and_only_what_all_read_alike_is_a_number() -> None:
    names = parse_yaml("[no, yes, on, off, y, N, No, OFF, true, False]", "names", "here")
    assert names == ["no", "yes", "on", "off", "y", "N", "No", "OFF", True, False]
    assert parse_yaml("[1e3, 1.5E-2, .5, 25., -3, +4, 0x1F, 0o17, 0]", "numbers", "here") == [
        *(1000.0, 0.015, 0.5, 25.0, -3, 4, 31, 15, 0),
    ]
    texts = ["12:30:45", "1_000", "0777", "007", "2026-11-28", "1,5", "0b11"]
    assert parse_yaml(f"[{', '.join(t for t in texts if ',' not in t)}, '1,5']", "texts", "here") == [
        *(text for text in texts if "," not in text),
        "1,5",
    ]


def test_keys_are_names_as_written_or_whole_numbers() -> None:
    assert parse_yaml("{0: a, no: b, 1e3: c, true: d, 0001: e}", "names", "here") == {
        **{0: "a", "no": "b", "1e3": "c", "true": "d", "0001": "e"}
    }


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("a: 1\nb: 2\na: 3\n", "line 3: the key `a` a second time, after line 1"),
        ("points:\n- {px: 1, m: 2, m: 3}\n", "line 2: the key `m` a second time, after line 2"),
        ("1: a\n'1': b\n", "line 2: the key `1` a second time"),
        ("a: [1, 2\n", "line 2: not YAML"),
        ("a: b: c\n", "line 1: not YAML"),
        ("a: *gone\n", "undefined alias"),
        ("--- 1\n--- 2\n", "another document"),
        ("\n\na: !!python/object:os.system 1\n", "line 3: a value marked `!!python/object:os.system`"),
        ("a: !!timestamp soon\n", "`!!timestamp`"),
        ("a: !!int three\n", "`three`, which is no int"),
        ("a: 1e999\n", "too large"),
        (f"a: {'9' * 5000}\n", "5000 digits"),
        ("a: &a [*a]\n", "an anchor within itself"),
        ("[" * 1500, "nested too deeply"),
        ("{[1]: 2}\n", "a key that is no name"),
        ("a: \x07\n", "line 1: not YAML"),
        ("<<: 3\n", "something else than mappings"),
    ],
)
def test_what_may_be_read_in_two_ways_or_not_at_all_is_refused_in_one_line(text: str, message: str) -> None:
    assert message in one_line(text)


def test_an_anchor_is_one_value_however_often_it_is_named() -> None:
    lines = ["a0: &a0 [x, x]"] + [f"a{k}: &a{k} [*a{k - 1}, *a{k - 1}]" for k in range(1, 40)]
    assert len(parse_yaml("\n".join(lines), "a", "here")) == 40


def test_a_merged_mapping_gives_way_to_what_is_said_itself() -> None:
    text = "base: &b {p: 1, q: 2}\nother: &c {q: 3, r: 4}\nboth:\n  q: 5\n  <<: [*b, *c]\n"
    assert parse_yaml(text, "a", "here")["both"] == {"p": 1, "q": 5, "r": 4}


_TEXTS = st.one_of(
    st.text(st.characters(codec="utf-8"), max_size=8),
    st.text("0123456789_:.-+exoXabfinty~<=", max_size=8),
    st.sampled_from(["no", "On", "null", "~", "1e3", "12:30:45", "0777", "1_0", "<<", "=", ".inf", "2026-11-28", ""]),
)


@given(
    st.dictionaries(_TEXTS.filter(bool), st.one_of(_TEXTS, st.booleans(), st.integers(), st.floats(allow_nan=False)))
)
def test_what_is_written_is_read_back_here_and_elsewhere(content: dict[str, object]) -> None:
    text = dump_yaml(content)
    assert parse_yaml(text, "content", "here") == content
    assert yaml.safe_load(text) == content


def test_a_written_file_is_read_back(tmp_path: Path) -> None:
    content = {"names": ["no", "ü"], "lr": 1e-7, "steps": 5, "mosaic": False, "weights": None}
    write_yaml(tmp_path / "run.yaml", content)
    assert read_yaml(tmp_path / "run.yaml", "a run") == content


@examples(200)
@given(mutated(st.just(_SETTINGS)))
def test_damaged_yaml_is_a_value_or_one_line(content: bytes) -> None:
    try:
        parse_yaml(content.decode(errors="replace"), "settings", "site.yaml", ConfigError)
    except ConfigError as error:
        assert "\n" not in str(error)


def test_json_with_a_key_twice_is_refused_with_both_lines(tmp_path: Path) -> None:
    path = tmp_path / "coco.json"
    path.write_text('{"images": [],\n "categories": [{"id": 1,\n "id": 2}]}')
    with pytest.raises(DataError, match=r"the key `id` twice in one object \(lines 2 and 3\)"):
        read_json(path, "a COCO file")
    path.write_text('[{"id": 1}, {"id": 1, "id": 2}]')
    with pytest.raises(DataError, match=r"the key `id` twice in one object\. Keep"):
        read_json(path, "a COCO file")


@pytest.mark.parametrize("text", ["{", "[" * 100_000, "9" * 5000, "nonsense"])
def test_what_is_no_json_gets_one_line(text: str) -> None:
    with pytest.raises(DataError, match="not JSON") as caught:
        parse_json(text, "a COCO file", "coco.json")
    assert "\n" not in str(caught.value)


@examples(200)
@given(mutated(st.just(json.dumps({"images": [{"id": 1, "file_name": "ä.jpg"}], "x": [1.5, None, True]}).encode())))
def test_damaged_json_is_a_value_or_one_line(content: bytes) -> None:
    try:
        parse_json(content.decode(errors="replace"), "a COCO file", "coco.json")
    except DataError as error:
        assert "\n" not in str(error)
