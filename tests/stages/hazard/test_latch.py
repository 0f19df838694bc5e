from __future__ import annotations

import pytest

from standoff.stages.hazard.latch import Latch


def states(latch: Latch, conditions: str, step_s: float = 0.25) -> str:
    """Feed one letter a frame (E enters, L leaves, - neither, ? not measured) and return 1 for on, 0 for off."""
    found = ""
    for frame, letter in enumerate(conditions):
        if letter == "?":
            latch.miss()
        else:
            latch.update(step_s * frame, enters=letter == "E", leaves=letter == "L")
        found += "1" if latch.on else "0"
    return found


def test_a_latch_follows_a_condition_that_holds() -> None:
    assert states(Latch(0.5, 0.5), "EEEELLLL") == "00111100"


def test_without_durations_a_latch_follows_at_once() -> None:
    assert states(Latch(0.0, 0.0), "ELEL") == "1010"


def test_what_does_not_hold_is_ignored() -> None:
    assert states(Latch(0.5, 0.5), "EELEEL") == "000000"
    assert states(Latch(0.5, 0.5), "EE-EEE") == "000001"
    assert states(Latch(0.5, 0.5), "EEELLELLL") == "001111110"
    assert states(Latch(0.5, 0.5), "EEELL-LLL") == "001111110"


def test_a_missing_measurement_is_no_step_towards_safety_and_none_back_from_danger() -> None:
    assert states(Latch(0.5, 0.5), "E??E") == "0001"
    assert states(Latch(0.5, 0.5), "EEEL??LLL") == "001111110"
    assert states(Latch(0.5, 0.5), "???") == "000"


@pytest.mark.parametrize("fps", [5.0, 10.0, 25.0, 30.0])
@pytest.mark.parametrize("start_s", [0.0, 0.4, 3600.2, 86_399.6])
def test_a_latch_turns_at_the_same_frame_whenever_it_begins(fps: float, start_s: float) -> None:
    """Frame times are rounded: a fifth of a second is more or less than 0.2 s, by what comes before."""
    frames = round(0.4 * fps)
    for first in range(50):
        latch = Latch(frames / fps, frames / fps)
        states = []
        for k in range(first, first + 2 * frames + 1):
            latch.update(start_s + k / fps, enters=k <= first + frames, leaves=k > first + frames)
            states.append(latch.on)
        assert states == [False] * frames + [True] * (frames + 1)
        latch.update(start_s + (first + 2 * frames + 1) / fps, enters=False, leaves=True)
        assert not latch.on
