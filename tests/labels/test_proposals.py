from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from labelled_sets import by_stem, write_picture
from pycocotools.coco import COCO

from standoff.core.errors import OutputError
from standoff.core.types import Detections
from standoff.labels import read_data
from standoff.labels.proposals import ProposedPicture, write_coco, write_label_studio

_CLASSES = ("worker", "excavator")


def _proposed(seed: int) -> list[ProposedPicture]:
    rng = np.random.default_rng(seed)
    pictures = []
    for number in range(4):
        first = rng.uniform(-0.5, 20, (number, 2))
        boxes = Detections(
            np.hstack([first, first + rng.uniform(1, 9, (number, 2))]),
            rng.uniform(0, 1, number),
            rng.integers(0, 2, number),
        )
        pictures.append(ProposedPicture(f"images/frame {number}.png", (40, 30), boxes))
    return pictures


@pytest.mark.parametrize("seed", range(3))
def test_what_is_proposed_in_cocos_layout_reads_back_as_it_was(tmp_path: Path, seed: int) -> None:
    pictures = _proposed(seed)
    for picture in pictures:
        write_picture(tmp_path / picture.file_name, picture.size_px)
    write_coco(pictures, _CLASSES, tmp_path / "annotations.json")
    data = read_data(tmp_path / "annotations.json")
    assert (data.classes, data.problems) == (_CLASSES, [])
    read = by_stem(data)
    for picture in pictures:
        labelled = read[Path(picture.file_name).stem]
        np.testing.assert_allclose(labelled.xyxy_px, picture.boxes.xyxy_px, atol=1e-9)
        assert labelled.class_id.tolist() == picture.boxes.class_id.tolist()
    peer = COCO(str(tmp_path / "annotations.json"))
    scores = [annotation["score"] for annotation in peer.loadAnns(peer.getAnnIds())]
    assert scores == [round(score, 4) for picture in pictures for score in picture.boxes.score.tolist()]
    areas = [annotation["area"] for annotation in peer.loadAnns(peer.getAnnIds())]
    np.testing.assert_allclose(areas, [box[2] * box[3] for box in (a["bbox"] for a in peer.anns.values())])


def test_label_studio_gets_boxes_in_per_cent_of_the_picture(tmp_path: Path) -> None:
    boxes = Detections(
        np.array([[-0.5, -0.5, 39.5, 29.5], [9.5, 14.5, 19.5, 29.5]]), np.array([0.5, 0.25]), np.array([0, 1])
    )
    pictures = [ProposedPicture("shots/a b.png", (40, 30), boxes), ProposedPicture("c.png", (40, 30), boxes[:0])]
    write_label_studio(pictures, _CLASSES, tmp_path / "tasks.json")
    first, second = json.loads((tmp_path / "tasks.json").read_text())
    assert first["data"] == {"image": "/data/local-files/?d=shots/a%20b.png"}
    (prediction,) = first["predictions"]
    assert prediction["score"] == 0.375
    whole, part = (result["value"] for result in prediction["result"])
    numbers = [whole[key] for key in ("x", "y", "width", "height", "rotation")]
    np.testing.assert_allclose(numbers, [0, 0, 100, 100, 0], atol=1e-9)
    np.testing.assert_allclose([part[key] for key in ("x", "y", "width", "height")], [25, 50, 25, 50])
    assert (whole["rectanglelabels"], part["rectanglelabels"]) == (["worker"], ["excavator"])
    assert {result["id"] for result in prediction["result"]} == {"box0", "box1"}
    sizes = {(result["original_width"], result["original_height"]) for result in prediction["result"]}
    assert sizes == {(40, 30)}
    assert second["predictions"][0]["result"] == []


def test_a_file_that_cannot_be_written_is_an_error_that_leaves_nothing(tmp_path: Path) -> None:
    (tmp_path / "taken.json").mkdir()
    for out in (tmp_path / "taken.json", tmp_path / "missing" / "a.json"):
        with pytest.raises(OutputError, match=out.name):
            write_coco(_proposed(0), _CLASSES, out)
    assert [path.name for path in tmp_path.iterdir()] == ["taken.json"]
