from __future__ import annotations

import pytest
from evaluation.detection.drawn_detections import detections, picture

from standoff.core.classes import CLASS_BY_NAME, CLASSES
from standoff.core.errors import ConfigError
from standoff.evaluation.detection.grouping import site_grouping

EVERY_ID = list(range(len(CLASSES)))
BOXES = [[10.0 * k, 10.0, 10.0 * k + 8.0, 30.0] for k in EVERY_ID]


def test_by_default_every_class_is_itself() -> None:
    grouping = site_grouping()
    truth, found = picture(BOXES, EVERY_ID), detections(BOXES, [0.5] * len(BOXES), EVERY_ID)
    assert grouping.classes == tuple(CLASS_BY_NAME)
    assert grouping.truth(truth).class_id.tolist() == grouping.found(found).class_id.tolist() == EVERY_ID
    assert not grouping.truth(truth).ignored.any()


def test_merged_machines_stand_beside_the_worker_and_the_reference_is_background() -> None:
    grouping = site_grouping(merge_machines=True)
    truth = grouping.truth(picture(BOXES, EVERY_ID))
    found = grouping.found(detections(BOXES, [0.5] * len(BOXES), EVERY_ID))
    assert truth.class_id.tolist() == found.class_id.tolist() == [0, 1, 1, 1, 1, 1]
    assert not truth.ignored.any()
    machines = ("excavator", "wheel_loader", "dump_truck", "roller_or_dozer", "vehicle")
    assert (grouping.members("worker"), grouping.members("machine")) == (("worker",), machines)


@pytest.mark.parametrize("merge_machines", [False, True])
def test_a_class_left_out_is_ignored_where_it_is_and_dropped_where_it_is_found(merge_machines: bool) -> None:
    grouping = site_grouping(merge_machines=merge_machines, without=["vehicle"])
    vehicle = CLASS_BY_NAME["vehicle"].id
    truth = grouping.truth(picture(BOXES[:2], [0, vehicle]))
    assert truth.ignored.tolist() == [False, True]
    assert grouping.found(detections(BOXES[:2], [0.5, 0.6], [vehicle, 0])).score.tolist() == [0.6]
    assert "vehicle" not in grouping.members(grouping.classes[-1])


def test_ignored_regions_stay_ignored_whatever_their_class() -> None:
    grouping = site_grouping(merge_machines=True)
    truth = grouping.truth(picture(BOXES, EVERY_ID, [True] * len(BOXES)))
    assert truth.ignored.all()
    assert len(truth.xyxy_px) == len(BOXES)


@pytest.mark.parametrize("without", [["crane"], list(CLASS_BY_NAME)])
def test_leaving_out_what_is_not_there_or_everything_is_one_line(without: list[str]) -> None:
    with pytest.raises(ConfigError, match="--without"):
        site_grouping(without=without)
