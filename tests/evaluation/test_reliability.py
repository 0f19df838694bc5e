from __future__ import annotations

import re

import numpy as np
import pytest
from pages import PageReader

from standoff.evaluation.paper.metrics import score_distances
from standoff.evaluation.reliability import Measured, reliability_section
from standoff.evaluation.stated_errors import score_coverage


def kind(name: str, measured_m: list[float]) -> Measured:
    true_m, estimate_m = np.full(len(measured_m), 10.0), np.array(measured_m)
    return name, score_distances(true_m, estimate_m), score_coverage(true_m, estimate_m, np.full(len(true_m), 0.5))


def test_a_section_shows_every_kind_with_its_curve() -> None:
    section = reliability_section(
        [kind("worker-excavator", [10.2, 10.7, 12.1, 10.0]), kind("worker-roller_or_dozer", [np.nan] * 3)],
        "this <film>",
    )
    text = PageReader.of(section).text
    assert "this <film>" in text and "<film>" not in section
    assert "worker-excavator 4 of 4 0.75 m 0.45 m 50 % 75 % 0.50 m" in text
    assert "worker-roller or dozer 0 of 3 none none none none none" in text
    assert not re.search(r"\bnan\b", section, re.IGNORECASE)


def test_nothing_measured_is_still_a_section() -> None:
    assert "How true the stated errors are" in reliability_section([], "no clip")


@pytest.mark.parametrize(("off_m", "inside"), [(0.49, 1.0), (0.51, 0.0)])
def test_inside_one_sigma_is_at_most_one_sigma_off(off_m: float, inside: float) -> None:
    (_, _, coverage) = kind("worker-excavator", [10.0 + off_m, 10.0 - off_m])
    assert coverage.inside_68 == inside and coverage.inside_95 == 1.0
