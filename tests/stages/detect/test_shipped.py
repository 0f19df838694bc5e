from __future__ import annotations

from pathlib import Path

import pytest

from standoff.core.classes import CLASS_BY_NAME
from standoff.core.errors import ModelError
from standoff.stages.detect import SHIPPED_MODELS, OnnxDetector, find_model


@pytest.mark.parametrize("path", ["yolo.onnx", "./site", "deep/site", "site.onnx"])
def test_everything_but_a_name_is_a_path(path: str) -> None:
    assert find_model(path) == Path(path)


@pytest.mark.parametrize("name", SHIPPED_MODELS)
def test_a_detector_that_the_installation_lacks_is_one_line(
    name: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr("standoff.stages.detect.shipped.files", lambda package: tmp_path / package)
    with pytest.raises(
        ModelError, match=f"detector '{name}' that comes with standoff.*Install standoff again"
    ) as caught:
        find_model(name)
    assert "\n" not in str(caught.value)
    path = tmp_path / "standoff" / "models" / f"{name}.onnx"
    path.parent.mkdir(parents=True)
    path.touch()
    assert find_model(name) == path


@pytest.mark.parametrize("name", SHIPPED_MODELS)
def test_a_shipped_detector_knows_all_classes_of_the_site(name: str) -> None:
    known = set(OnnxDetector(find_model(name)).describe()["class_map"].values())
    assert known == set(CLASS_BY_NAME)
