from __future__ import annotations

from standoff.stages.hazard.life import Latch


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
