"""When a source is opened, and when it says what is wrong with it."""

from __future__ import annotations

from collections.abc import Callable
from pathlib import Path

import pytest
from stages.frames.coded_video import write_video
from stages.frames.test_folder import fill

from standoff.core.errors import SourceError
from standoff.stages.frames import FileSource, open_source

QUESTIONS: dict[str, Callable[[FileSource], object]] = {
    "size_px": lambda source: source.size_px,
    "frame_count": lambda source: source.frame_count,
    "describe": lambda source: source.describe(),
    "frames": lambda source: source.frames(),
}


@pytest.mark.parametrize("name", QUESTIONS)
def test_each_question_opens_a_source_that_was_not_there_when_it_was_asked_for(name: str, tmp_path: Path) -> None:
    """A film, and a folder of pictures, that come later are read; until then every question says what is missing."""
    ask = QUESTIONS[name]
    film, folder = open_source(tmp_path / "later.mp4"), open_source(tmp_path / "later", fps=10.0)
    for source in (film, folder):
        with pytest.raises(SourceError, match="found nothing at"):
            ask(source)
    write_video(tmp_path / "later.mp4", 5)
    fill(tmp_path / "later", 4)
    for source, count in ((film, 5), (folder, 4)):
        ask(source)
        assert len(list(source)) == count
        source.close()


def test_a_source_that_was_closed_is_not_opened_any_more(tmp_path: Path) -> None:
    source = open_source(write_video(tmp_path / "film.mp4", 3))
    source.close()
    with pytest.raises(ValueError, match="closed before it was opened"):
        source.describe()


def test_frames_end_where_the_source_is_closed(tmp_path: Path) -> None:
    source = open_source(write_video(tmp_path / "film.mp4", 6))
    frames = source.frames()
    next(frames)
    source.close()
    assert list(frames) == []
