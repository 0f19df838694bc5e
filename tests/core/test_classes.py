from __future__ import annotations

import pytest

from standoff.core.classes import CLASS_BY_NAME, CLASSES, Role, class_ids, names_by_line


def test_an_id_is_the_place_in_the_list_and_names_are_distinct() -> None:
    assert [site_class.id for site_class in CLASSES] == list(range(len(CLASSES)))
    assert len(CLASS_BY_NAME) == len(CLASSES)
    assert all(CLASS_BY_NAME[site_class.name] is site_class for site_class in CLASSES)


@pytest.mark.parametrize(("name", "radius_m"), [("worker", 2.0), ("wheel_loader", 5.8), ("excavator", 12.1)])
def test_the_papers_action_radii_are_kept(name: str, radius_m: float) -> None:
    assert CLASS_BY_NAME[name].action_radius_m == radius_m


def test_every_class_has_one_role_and_whatever_moves_has_a_size() -> None:
    ids = [class_id for role in Role for class_id in class_ids(role)]
    assert sorted(ids) == list(range(len(CLASSES)))
    for class_id in (*class_ids(Role.PERSON), *class_ids(Role.EQUIPMENT)):
        site_class = CLASSES[class_id]
        assert site_class.height_m > 0
        assert site_class.length_m >= site_class.width_m > 0
        assert site_class.action_radius_m > site_class.length_m / 2


def test_there_is_exactly_one_reference_class_and_it_endangers_nobody() -> None:
    (reference,) = class_ids(Role.REFERENCE)
    assert CLASSES[reference].action_radius_m == 0.0


@pytest.mark.parametrize(
    "text",
    [
        "worker,excavator\n",
        "worker; excavator",
        "worker,\nexcavator,\nlorry\n",
        "- worker\n- excavator\n",
        "'worker'\n'excavator'\n",
        "worker: 0\nexcavator: 1\n",
        "1 worker\n2 excavator\n",
        "1 excavator\n0 worker\n",
    ],
)
def test_a_list_of_names_in_another_way_is_no_list_of_other_names(text: str) -> None:
    with pytest.raises(ValueError, match=r"one a line|names alone"):
        names_by_line(text)


@pytest.mark.parametrize(
    ("text", "names"),
    [
        ("0 worker\n1: excavator\n", ("worker", "excavator")),
        ("tench, Tinca tinca\ngoldfish\nshark, great\n", ("tench, Tinca tinca", "goldfish", "shark, great")),
        ("0\n1\n2\n", ("0", "1", "2")),
        ("3 axles\n4 axles\n", ("3 axles", "4 axles")),
        ("no-entry\n- \n", ("no-entry", "-")),
    ],
)
def test_names_are_as_they_stand(text: str, names: tuple[str, ...]) -> None:
    assert names_by_line(text) == names
