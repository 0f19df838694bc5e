from __future__ import annotations

import pytest

from standoff.stages.detect import DetectParams


@pytest.mark.parametrize(
    ("settings", "message"),
    [
        ({"class_map": {"person": "wroker"}}, "class_map sends 'person' to 'wroker'"),
        ({"class_score_thresholds": {"person": 0.3}}, "class_score_thresholds names 'person'"),
        ({"class_score_thresholds": {"worker": 1.3}}, "must lie between 0 and 1, not 1.3"),
        ({"slices": (0, 2)}, r"slices must be at least \(1, 1\)"),
    ],
)
def test_settings_that_contradict_are_refused(settings: dict[str, dict[str, str]], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        DetectParams(**settings)  # type: ignore[arg-type]
