"""Labelled pictures: read them, check them, write proposals for those who label.

>>> from standoff.labels import read_data, load_picture
>>> data = read_data(Path("data"))  # doctest: +SKIP
>>> image = load_picture(data.splits["train"][0])  # doctest: +SKIP
"""

from standoff.labels.pictures import load_picture
from standoff.labels.proposals import ProposedPicture, write_coco, write_label_studio
from standoff.labels.read import read_data
from standoff.labels.site_classes import to_site_classes
from standoff.labels.types import SPLITS, LabelledData, LabelledPicture, Problem, Split

__all__ = [
    "SPLITS",
    "LabelledData",
    "LabelledPicture",
    "Problem",
    "ProposedPicture",
    "Split",
    "load_picture",
    "read_data",
    "to_site_classes",
    "write_coco",
    "write_label_studio",
]
