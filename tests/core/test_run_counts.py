from __future__ import annotations

from stages.sinks.fake_site import FakeSite, ended

from standoff.core.hazards import OpenHazards


def test_what_happened_is_counted() -> None:
    results = list(FakeSite((64, 36)).results(100))
    counts = ended(results).counts
    assert counts.rows["frames"] == 100
    assert counts.rows["frames_with_map"] == 80
    assert counts.no_map == {"reference hidden & <not> found": 20}
    assert counts.invalid == {"no ground map": 100, "outside the trusted area": 15}
    assert (counts.rows["tracks"], counts.rows["pairs"]) == (5, 6)
    assert counts.hazards.total() == len({event.hazard_id for result in results for event in result.hazards})


def test_what_is_open_is_what_was_opened_and_not_closed() -> None:
    results = list(FakeSite((64, 36)).results(150))
    opened: set[str] = set()
    for result in results:
        opened |= {event.hazard_id for event in result.hazards if event.phase != "closed"}
        opened -= {event.hazard_id for event in result.hazards if event.phase == "closed"}
        assert {event.hazard_id for event in result.open_hazards.latest} == opened
    assert not opened and not results[-1].open_hazards.latest


def test_one_moment_after_another_is_both_at_once() -> None:
    first, second = (result.hazards for result in FakeSite((64, 36)).results(2))
    assert OpenHazards().after(first).after(second) == OpenHazards().after((*first, *second))
