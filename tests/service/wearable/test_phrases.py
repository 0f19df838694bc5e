"""Whatever a receiver has to say it can say in every language, and every level is felt."""

from __future__ import annotations

import string
from typing import get_args

import pytest

from standoff.core.classes import CLASSES
from standoff.core.errors import ConfigError
from standoff.service.wearable import LANGUAGES, Level, Phrases
from standoff.service.wearable.phrases import read_vibrations

LEVELS: tuple[str, ...] = get_args(Level)


def placeholders(text: str) -> set[str]:
    return {name for _, name, _, _ in string.Formatter().parse(text) if name is not None}


def test_there_is_more_than_one_language() -> None:
    assert {"de", "en"} <= set(LANGUAGES)


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_phrase_is_there_in_every_language_with_the_same_parts(language: str) -> None:
    words, english = Phrases.read(language).words, Phrases.read("en").words
    assert words.keys() == english.keys()
    for name, text in words.items():
        assert text.strip() and placeholders(text) == placeholders(english[name]), name


@pytest.mark.parametrize("language", LANGUAGES)
def test_every_level_and_everybody_on_a_site_has_a_name(language: str) -> None:
    words = Phrases.read(language).words
    on_site = {one.name for one in CLASSES} - {"reference"}
    assert {*LEVELS, "supervised_more", "unsupervised_more", "unknown_more", *on_site} <= words.keys()
    assert len({words[level] for level in LEVELS}) == len(LEVELS)


def test_a_phrase_that_nobody_wrote_is_its_name() -> None:
    assert Phrases.read("en").say("unicorn", distance="1") == "unicorn"
    assert Phrases.read("en").say("unknown_more", reason="{nobody} knows").endswith("{nobody} knows")


def test_a_language_that_nobody_wrote_is_refused() -> None:
    with pytest.raises(ConfigError, match="a language, de, en"):
        Phrases.read("tlh")


def test_every_level_has_a_pattern_of_its_own_and_danger_the_longest() -> None:
    patterns = read_vibrations()
    assert patterns.keys() == set(LEVELS)
    assert len({pattern for pattern, _ in patterns.values()}) == len(LEVELS)
    assert all(
        times >= 1 and pattern and all(part_ms > 0 for part_ms in pattern) for pattern, times in patterns.values()
    )
    felt_ms = {level: times * sum(pattern[::2]) for level, (pattern, times) in patterns.items()}
    assert max(felt_ms, key=lambda level: felt_ms[level]) == "danger"
