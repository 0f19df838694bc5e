"""What the documentation shows can be done: Python is executed, command lines are parsed, settings are checked.

All Python snippets of a page are one program, executed in a folder with the files that pages speak of (`workshop`).
A snippet after the line `<!-- snippet: live -->` takes long: `make test-live` alone executes it, after those before it.
"""

from __future__ import annotations

import re
import shlex
import shutil
from dataclasses import dataclass
from functools import cache
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow.parquet as pq
import pytest
import typer
import yaml
from golden.make import DETECTIONS, FILM, GOLDEN
from labelled_sets import write_mixture, write_yolo

from standoff.cli.app import app
from standoff.config import Settings, load_settings, load_site
from standoff.core.errors import StandoffError

PROJECT = Path(__file__).resolve().parents[2]
PAGES = (PROJECT / "README.md", *sorted((PROJECT / "docs").glob("*.md")))
CARDS = sorted(
    path for place in ("examples/*", "src/standoff/*", "simulator") for path in PROJECT.glob(f"{place}/README.md")
)
LANGUAGES = {"python", "console", "yaml", "json", "xml", "text"}
"""What is typed is `console`, so that nothing escapes these tests as `bash` or as no language."""
FOR_SITE_MANAGERS = ("first-site", "report", "reference-objects", "zones")

_FENCE = re.compile(
    r"^(?P<live><!-- snippet: live -->\n+)?```(?P<language>\w+)\n(?P<text>.*?)^```$", re.MULTILINE | re.DOTALL
)
_INLINE = re.compile(r"`(standoff\s[^`]+)`")
_LINK = re.compile(r"\]\((?!https?:)(?P<path>[^)#\s]*)(?:#(?P<anchor>[^)\s]+))?\)")
_CLIP = ("video.mp4", "camera.yaml", "reference.yaml", "scene.json", "truth.parquet", "pairs.parquet", "frames.parquet")


@dataclass(frozen=True)
class Snippet:
    """A part of a page between two fences."""

    text: str
    line: int
    is_live: bool


def test_every_fence_of_a_page_says_its_language() -> None:
    for page in PAGES:
        fences = re.findall(r"^```.*$", page.read_text(encoding="utf-8"), re.MULTILINE)
        assert {fence.removeprefix("```") for fence in fences[::2]} <= LANGUAGES, page
        assert {*fences[1::2]} <= {"```"}, page


def snippets(page: Path, *languages: str) -> list[Snippet]:
    text = page.read_text(encoding="utf-8")
    found = [match for match in _FENCE.finditer(text) if match["language"] in languages]
    return [
        Snippet(match["text"], text.count("\n", 0, match.start("text")), match["live"] is not None) for match in found
    ]


def having(*languages: str) -> list[Any]:
    return [pytest.param(page, id=page.stem) for page in PAGES if snippets(page, *languages)]


# --- Python -------------------------------------------------------------------------------------------------------


def executions() -> list[Any]:
    """Return pages, once without what takes long, and again with it where there is some."""
    found: list[Any] = []
    for page in PAGES:
        takes_long = {one.is_live for one in snippets(page, "python")}
        if False in takes_long:
            found.append(pytest.param(page, False, id=page.stem))
        if True in takes_long:
            found.append(pytest.param(page, True, id=f"{page.stem}-live", marks=pytest.mark.live))
    return found


@pytest.fixture
def workshop(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Enter a folder with the shipped film as `site.mp4`, what is known of it, a run of it and labelled pictures."""
    (tmp_path / "site.mp4").symlink_to(FILM / "video.mp4")
    shutil.copy(FILM / "camera.yaml", tmp_path)
    site = yaml.safe_load((FILM / "reference.yaml").read_text())
    site |= {"detections": str(DETECTIONS), "source": {"stop_s": 0.3, "every": 2}, "outputs": ["tracks", "hazards"]}
    (tmp_path / "site.yaml").write_text(yaml.safe_dump(site))
    cameras = {"defaults": site, "streams": {name: {"address": "replay://site.mp4"} for name in ("gate", "crane-2")}}
    (tmp_path / "cameras.yaml").write_text(yaml.safe_dump(cameras))
    (tmp_path / "survey.yaml").write_text(yaml.safe_dump(true_survey()))
    shutil.copytree(GOLDEN, tmp_path / "out")
    clip = tmp_path / "clips" / "mobile"
    clip.mkdir(parents=True)
    for name in _CLIP:
        (clip / name).symlink_to(FILM / name)
    lines = {f"flight{number}-{frame}": "0 0.5 0.5 0.3 0.4\n" for number in range(3) for frame in range(2)}
    write_yolo(tmp_path / "labelled", lines)
    write_mixture(tmp_path / "mixture.yaml", {"path": "labelled", "groups": {"val": ["flight2"]}})
    monkeypatch.chdir(tmp_path)
    return tmp_path


def true_survey() -> dict[str, Any]:
    """Return a survey of the film: the footing's foot in its first picture."""
    frame = pq.read_table(FILM / "frames.parquet").slice(0, 1).to_pylist()[0]
    pixels = np.column_stack([frame["reference_base_x_px"], frame["reference_base_y_px"]])
    places = yaml.safe_load((FILM / "scene.json").read_text())["reference"]["base_m"]
    points = [
        {"name": f"foot {k}", "px": [float(x) for x in pixel], "m": [float(x) for x in place[:2]]}
        for k, (pixel, place) in enumerate(zip(pixels, places, strict=True))
    ]
    return {"image_size_px": [1920, 1080], "points": points}


@pytest.mark.parametrize(("page", "all_of_it"), executions())
@pytest.mark.usefixtures("workshop")
def test_the_python_of_a_page_runs(page: Path, all_of_it: bool) -> None:
    names: dict[str, Any] = {"__name__": "snippet"}
    for snippet in snippets(page, "python"):
        if all_of_it or not snippet.is_live:
            # Lines of an error are those of the page.
            program = compile("\n" * snippet.line + snippet.text, str(page), "exec", dont_inherit=True)
            exec(program, names)


# --- Settings -----------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", having("yaml"))
def test_the_settings_of_a_page_are_valid(page: Path, tmp_path: Path) -> None:
    for snippet in snippets(page, "yaml"):
        keys = yaml.safe_load(snippet.text)
        path = tmp_path / "site.yaml"
        path.write_text(snippet.text)
        if isinstance(keys, dict) and "streams" in keys:
            load_site(path)
        elif isinstance(keys, dict) and keys.keys() & Settings.model_fields.keys():
            load_settings(path)


# --- Command lines ------------------------------------------------------------------------------------------------


def command_lines(page: Path) -> list[str]:
    """Return what follows the prompts of a page, one command each, without optional brackets."""
    lines: list[str] = []
    for snippet in snippets(page, "console"):
        for line in snippet.text.replace("\\\n", " ").splitlines():
            # A page's output of a command has no prompt.
            if line.startswith("$ "):
                lines += line.removeprefix("$ ").split(" && ")
    return lines


def inline_commands(page: Path) -> list[str]:
    """Return the commands within the prose of a page; one with `a|b` is two."""
    prose = _FENCE.sub("", page.read_text(encoding="utf-8"))
    found: list[str] = []
    for text in _INLINE.findall(prose):
        choices = [word.split("|") for word in text.replace("\\|", "|").split()]
        found += [" ".join(words) for words in product(*choices)]
    return found


def words_of(command: str) -> list[str]:
    """Return the words of a command line up to where its output goes; any preset is one of them.

    What is optional is in it, `...` is not.

    >>> words_of("standoff evaluate positions RUN --truth gt.csv [--min-overlap 0.5]   # of people")
    ['standoff', 'evaluate', 'positions', 'RUN', '--truth', 'gt.csv', '--min-overlap', '0.5']
    """
    words = shlex.split(re.sub(r"\[(.*?)\]", r"\1", command), comments=True)
    words = words[: words.index(">")] if ">" in words else words
    return [{"PRESET": "busy"}.get(word, word) for word in words if word != "..."]


@cache
def command_tree() -> Any:
    """Return the verbs, built once; typer carries its own click, which has no public name."""
    return typer.main.get_command(app)


def parse(words: list[str], *, whole: bool) -> None:
    """Parse the words after `standoff` as it would.

    Args:
        words: Verbs, arguments and options.
        whole: All that is needed must be there, with values that are possible.
    """
    command, context, name = command_tree(), None, "standoff"
    while hasattr(command, "resolve_command"):
        context = command.context_class(command, info_name=name, parent=context)
        _, rest, _ = command.make_parser(context).parse_args(list(words))
        if not rest:
            return
        name, command, words = command.resolve_command(context, rest)
    if whole:
        command.make_context(name, list(words), parent=context)
    else:
        context = command.context_class(command, info_name=name, parent=context)
        # An option may be named without its value.
        command.make_parser(context).parse_args([*words, "VALUE"])


def check(command: str, *, whole: bool) -> None:
    words = words_of(command)
    while words and re.fullmatch(r"[A-Z_]+=\S*", words[0]):
        words.pop(0)
    match words:
        case ["standoff", *rest]:
            parse(rest, whole=whole)
        case ["make", target, *_]:
            assert re.search(rf"^{target}:", (PROJECT / "Makefile").read_text(), re.MULTILINE), f"no target {target}"
        case ["python", script, *_] if "/" in script:
            assert (PROJECT / script).is_file(), f"no {script}"


@pytest.mark.parametrize("page", having("console"))
def test_the_command_lines_of_a_page_can_be_typed(page: Path) -> None:
    wrong = refused(command_lines(page), whole=True)
    assert not wrong, "\n".join(wrong)


@pytest.mark.parametrize("page", [pytest.param(page, id=page.parent.name + page.stem) for page in (*PAGES, *CARDS)])
def test_the_verbs_and_options_that_a_text_names_exist(page: Path) -> None:
    wrong = refused(inline_commands(page), whole=False)
    assert not wrong, "\n".join(wrong)


def refused(commands: list[str], *, whole: bool) -> list[str]:
    """Return which commands cannot be parsed, and why."""
    wrong: list[str] = []
    for command in commands:
        try:
            check(command, whole=whole)
        except AssertionError as error:
            wrong.append(f"{command}: {error}")
        except StandoffError as error:
            wrong.append(f"{command}: {error}")
        except Exception as error:
            if not hasattr(error, "format_message"):
                raise
            wrong.append(f"{command}: {error.format_message()}")
    return wrong


@pytest.mark.parametrize(
    "command",
    [
        "standoff run site.mp4 --out out --speed 3", "standoff run --out out", "standoff wink", "make coffee",
        "standoff simulate mobil --out clip", "python examples/none.py",
    ],
)  # fmt: skip
def test_a_command_that_nobody_can_type_is_found(command: str) -> None:
    assert refused([command], whole=True)


# --- Pages --------------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("page", [pytest.param(page, id=page.stem) for page in PAGES[1:]])
def test_a_page_begins_with_the_question_that_it_answers(page: Path) -> None:
    title, _, rest = page.read_text(encoding="utf-8").partition("\n\n")
    first = re.split(r"(?<=[.?!:])\s", rest, maxsplit=1)[0]
    assert title.startswith("# ")
    assert first.endswith("?"), first


@pytest.mark.parametrize("name", FOR_SITE_MANAGERS)
def test_whoever_runs_a_site_reads_nothing_of_model_and_table_formats(name: str) -> None:
    text = (PROJECT / "docs" / f"{name}.md").read_text(encoding="utf-8")
    assert not re.findall(r"onnx|parquet|darknet|yolo|ultralytics", text, re.IGNORECASE)


def anchors(page: Path) -> set[str]:
    """Return the anchors of a page's headings, as the site and as code hosts make them."""
    headings = re.findall(r"^#+ (.*)$", _FENCE.sub("", page.read_text(encoding="utf-8")), re.MULTILINE)
    plain = [re.sub(r"[^\w\s-]", "", heading.lower()) for heading in headings]
    return {re.sub(gap, "-", text) for text in plain for gap in (r"\s", r"[-\s]+")}


@pytest.mark.parametrize("page", [pytest.param(page, id=page.parent.name + page.stem) for page in (*PAGES, *CARDS)])
def test_the_links_of_a_text_lead_somewhere(page: Path) -> None:
    broken = []
    for link in _LINK.finditer(_FENCE.sub("", page.read_text(encoding="utf-8"))):
        target = (page.parent / link["path"]).resolve() if link["path"] else page
        if not target.exists() or (link["anchor"] and link["anchor"] not in anchors(target)):
            broken.append(link[0])
    assert not broken
