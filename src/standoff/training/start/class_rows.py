"""Which classes of a trained head a new head's classes start from."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from types import MappingProxyType
from typing import Final

_COCO: Final = (
    "person,bicycle,car,motorbike,aeroplane,bus,train,truck,boat,traffic light,fire hydrant,stop sign,parking meter,"
    "bench,bird,cat,dog,horse,sheep,cow,elephant,bear,zebra,giraffe,backpack,umbrella,handbag,tie,suitcase,frisbee,"
    "skis,snowboard,sports ball,kite,baseball bat,baseball glove,skateboard,surfboard,tennis racket,bottle,wine glass,"
    "cup,fork,knife,spoon,bowl,banana,apple,sandwich,orange,broccoli,carrot,hot dog,pizza,donut,cake,chair,sofa,"
    "pottedplant,bed,diningtable,toilet,tvmonitor,laptop,mouse,remote,keyboard,cell phone,microwave,oven,toaster,sink,"
    "refrigerator,book,clock,vase,scissors,teddy bear,hair drier,toothbrush"
)
COCO_CLASSES: Final = tuple(_COCO.split(","))
"""The classes of every Darknet network that was trained on COCO, in its order."""

ALIKE: Final[Mapping[str, tuple[str, ...]]] = MappingProxyType(
    {
        "worker": ("person",),
        "vehicle": ("car",),
        "dump_truck": ("truck",),
        "excavator": ("truck",),
        "wheel_loader": ("truck",),
        "roller_or_dozer": ("truck",),
    }
)
"""What COCO calls a class. Machines have no name there; a network that knows COCO takes them for trucks."""


def class_sources(classes: Sequence[str], source_classes: Sequence[str]) -> tuple[tuple[int, ...], ...]:
    """Return for each class the positions of the source's classes that it starts from, none if there is none.

    >>> class_sources(["worker", "car", "reference"], ["car", "person"])
    ((1,), (0,), ())
    """
    position = {name: number for number, name in enumerate(source_classes)}
    return tuple(
        (position[name],)
        if name in position
        else tuple(position[alike] for alike in ALIKE.get(name, ()) if alike in position)
        for name in classes
    )
