from __future__ import annotations

import pytest

from standoff.core.class_map import DEFAULT_CLASS_MAP, map_classes
from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError


def test_every_class_of_the_site_is_its_own_label() -> None:
    labels = tuple(CLASS_BY_NAME)
    assert map_classes(labels, {}, "m.onnx") == {name: name for name in labels}


def test_common_labels_have_a_class_of_the_site() -> None:
    labels = ("person", "car", "bus", "truck", "motorbike", "Wheel Loader", "dump-truck", "kite")
    mapped = map_classes(labels, {}, "m.onnx")
    assert list(mapped.values()) == ["worker", *4 * ["vehicle"], "wheel_loader", "dump_truck"]
    assert "kite" not in mapped
    assert set(DEFAULT_CLASS_MAP.values()) <= set(CLASS_BY_NAME)


def test_an_override_goes_before_the_default() -> None:
    overrides = {"truck": "dump_truck", "car": "ignore", "kite": "reference"}
    assert map_classes(("car", "truck", "kite"), overrides, "m.onnx") == {"truck": "dump_truck", "kite": "reference"}


def test_an_override_of_no_label_is_refused() -> None:
    with pytest.raises(ModelError, match=r"labels of m\.onnx in the class map \(car, kite\), found 'persn'"):
        map_classes(("car", "kite"), {"persn": "worker"}, "m.onnx")


def test_a_model_without_any_class_of_the_site_is_refused_with_its_labels() -> None:
    with pytest.raises(ModelError, match="found kite, sheep"):
        map_classes(("kite", "sheep"), {}, "m.onnx")
