"""Networks with the same layers, in the same order and joined in the same way, as published ones, but narrower.

Layers are written as Darknet's own cfg files write them; only filters are divided.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence

NARROWER = 16
"""What filters are divided by; heads keep theirs."""
SMALLER = 9
"""What anchors are divided by, so that boxes are about as large as the input at most."""
_NINE = (12, 16, 19, 36, 40, 28, 36, 75, 76, 55, 72, 146, 142, 110, 192, 243, 459, 401)
_SIX = (10, 14, 23, 27, 37, 58, 81, 82, 135, 169, 344, 319)
CLASSES = 3


class _Text:
    """Layers one after another."""

    def __init__(self, size_px: tuple[int, int], activation: str, net: str = "") -> None:
        self.activation = activation
        self.sections = [f"[net]\nwidth={size_px[0]}\nheight={size_px[1]}\nchannels=3\n{net}"]

    def conv(self, filters: int, size: int = 1, stride: int = 1, activation: str = "") -> None:
        self.sections.append(
            f"[convolutional]\nbatch_normalize=1\nfilters={max(2, filters // NARROWER)}\nsize={size}\nstride={stride}\n"
            f"pad=1\nactivation={activation or self.activation}\n"
        )

    def route(self, *layers: int, more: str = "") -> None:
        self.sections.append(f"[route]\nlayers = {', '.join(map(str, layers))}\n{more}")

    def shortcut(self) -> None:
        self.sections.append("[shortcut]\nfrom=-3\nactivation=linear\n")

    def maxpool(self, size: int, stride: int) -> None:
        self.sections.append(f"[maxpool]\nstride={stride}\nsize={size}\n")

    def upsample(self) -> None:
        self.sections.append("[upsample]\nstride=2\n")

    def head(self, mask: str, anchors: Sequence[int], activation: str, options: str) -> None:
        sides = ", ".join(f"{side / SMALLER:.3g}" for side in anchors)
        self.sections.append(
            f"[convolutional]\nsize=1\nstride=1\npad=1\nfilters={3 * (5 + CLASSES)}\nactivation={activation}\n"
        )
        self.sections.append(
            f"[yolo]\nmask = {mask}\nanchors = {sides}\nclasses={CLASSES}\nnum={len(anchors) // 2}\njitter=.3\n"
            "ignore_thresh = .7\ntruth_thresh = 1\nrandom=0\niou_loss=ciou\nnms_kind=greedynms\nbeta_nms=0.6\n"
            + options
        )

    def spatial_pyramid(self) -> None:
        for back, size in ((-2, 5), (-4, 9)):
            self.maxpool(size, 1)
            self.route(back)
        self.maxpool(13, 1)
        self.route(-1, -3, -5, -6)

    def text(self) -> str:
        return "\n".join(self.sections)


def _cross_stage(text: _Text, filters: int, blocks: int) -> None:
    """A halving and a cross-stage partial stage of a CSPDarknet53."""
    half = filters // 2
    text.conv(filters, 3, 2)
    text.conv(half)
    text.route(-2)
    text.conv(half)
    for _ in range(blocks):
        text.conv(half)
        text.conv(half, 3)
        text.shortcut()
    text.conv(half)
    text.route(-1, -(3 * blocks + 4))
    text.conv(filters)


def yolov4(size_px: tuple[int, int]) -> str:
    """CSPDarknet53 with mish, spatial pyramid, and a path aggregation with leaky."""
    text = _Text(size_px, "mish")
    text.conv(32, 3)
    text.conv(64, 3, 2)
    text.conv(64)
    text.route(-2)
    text.conv(64)
    text.conv(32)
    text.conv(64, 3)
    text.shortcut()
    text.conv(64)
    text.route(-1, -7)
    text.conv(64)
    for filters, blocks in ((128, 2), (256, 8), (512, 8), (1024, 4)):
        _cross_stage(text, filters, blocks)
    text.activation = "leaky"
    _in_and_out(text, 512, 1)
    text.conv(512)
    text.spatial_pyramid()
    _in_and_out(text, 512, 1)
    text.conv(512)
    for filters, joined in ((256, 85), (128, 54)):
        text.conv(filters)
        text.upsample()
        text.route(joined)
        text.conv(filters)
        text.route(-1, -3)
        _in_and_out(text, filters, 2)
        text.conv(filters)
    for number, (filters, scale, back) in enumerate(((128, 1.2, 0), (256, 1.1, -16), (512, 1.05, -37))):
        if back:
            text.route(-4)
            text.conv(filters, 3, 2)
            text.route(-1, back)
            _in_and_out(text, filters, 2)
            text.conv(filters)
        text.conv(2 * filters, 3)
        mask = ",".join(str(3 * number + anchor) for anchor in range(3))
        text.head(mask, _NINE, "linear", f"scale_x_y = {scale}\nmax_delta=5\n")
    return text.text()


def _in_and_out(text: _Text, filters: int, times: int) -> None:
    for _ in range(times):
        text.conv(filters)
        text.conv(2 * filters, 3)


def yolov4_tiny(size_px: tuple[int, int]) -> str:
    """Routes that take the second half of a layer's channels."""
    text = _Text(size_px, "leaky")
    text.conv(32, 3, 2)
    text.conv(64, 3, 2)
    for filters in (64, 128, 256):
        text.conv(filters, 3)
        text.route(-1, more="groups=2\ngroup_id=1\n")
        text.conv(filters // 2, 3)
        text.conv(filters // 2, 3)
        text.route(-1, -2)
        text.conv(filters)
        text.route(-6, -1)
        text.maxpool(2, 2)
    text.conv(512, 3)
    text.conv(256)
    text.conv(512, 3)
    text.head("3,4,5", _SIX, "linear", "scale_x_y = 1.05\nresize=1.5\n")
    text.route(-4)
    text.conv(128)
    text.upsample()
    text.route(-1, 23)
    text.conv(256, 3)
    text.head("1,2,3", _SIX, "linear", "scale_x_y = 1.05\nresize=1.5\n")
    return text.text()


_SCALED = "scale_x_y = 2.0\nnew_coords=1\nobjectness_smooth=1\nobj_normalizer=4.0\nresize=1.5\niou_thresh=0.2\n"


def _partial(text: _Text, filters: int) -> None:
    """A cross-stage partial block of the neck."""
    text.conv(filters)
    text.conv(filters)
    text.route(-2)
    text.conv(filters)
    text.conv(filters, 3)
    text.conv(filters)
    text.conv(filters, 3)
    text.route(-1, -6)
    text.conv(filters)


def yolov4_csp(size_px: tuple[int, int]) -> str:
    """Mish everywhere, a neck of cross-stage partial blocks, heads in new coordinates."""
    text = _Text(size_px, "mish", "letter_box=1\n")
    text.conv(32, 3)
    text.conv(64, 3, 2)
    text.conv(32)
    text.conv(64, 3)
    text.shortcut()
    for filters, blocks in ((128, 2), (256, 8), (512, 8), (1024, 4)):
        _cross_stage(text, filters, blocks)
    text.conv(512)
    text.route(-2)
    text.conv(512)
    text.conv(512, 3)
    text.conv(512)
    text.spatial_pyramid()
    text.conv(512)
    text.conv(512, 3)
    text.route(-1, -13)
    text.conv(512)
    for filters, joined in ((256, 79), (128, 48)):
        text.conv(filters)
        text.upsample()
        text.route(joined)
        text.conv(filters)
        text.route(-1, -3)
        _partial(text, filters)
    for number, (filters, back) in enumerate(((128, 0), (256, -20), (512, -49))):
        if back:
            text.route(-4)
            text.conv(filters, 3, 2)
            text.route(-1, back)
            _partial(text, filters)
        text.conv(2 * filters, 3)
        mask = ",".join(str(3 * number + anchor) for anchor in range(3))
        text.head(mask, _NINE, "logistic", _SCALED)
    return text.text()


def _layers_together(text: _Text, half: int, filters: int) -> None:
    """An efficient layer aggregation of YOLOv7-tiny."""
    text.conv(half)
    text.route(-2)
    text.conv(half)
    text.conv(half, 3)
    text.conv(half, 3)
    text.route(-5, -3, -2, -1)
    text.conv(filters)


def yolov7_tiny(size_px: tuple[int, int]) -> str:
    """Layer aggregation, a spatial pyramid and heads in new coordinates."""
    text = _Text(size_px, "leaky")
    text.conv(32, 3, 2)
    text.conv(64, 3, 2)
    for number, half in enumerate((32, 64, 128, 256)):
        if number:
            text.maxpool(2, 2)
        _layers_together(text, half, 2 * half)
    text.conv(256)
    text.route(-2)
    text.conv(256)
    text.spatial_pyramid()
    text.conv(256)
    text.route(-10, -1)
    text.conv(256)
    for filters, joined in ((128, 24), (64, 16)):
        text.conv(filters)
        text.upsample()
        text.route(joined)
        text.conv(filters)
        text.route(-1, -3)
        _layers_together(text, filters // 2, filters)
    for filters, joined in ((128, 56), (256, 44)):
        text.conv(filters, 3, 2)
        text.route(-1, joined)
        _layers_together(text, filters // 2, filters)
    for number, (filters, joined) in enumerate(((128, 68), (256, 77), (512, 86))):
        text.route(joined)
        text.conv(filters, 3)
        mask = ",".join(str(3 * number + anchor) for anchor in range(3))
        text.head(mask, _NINE, "logistic", _SCALED)
    return text.text()


def swish(size_px: tuple[int, int]) -> str:
    """What the others lack."""
    text = _Text(size_px, "swish")
    text.conv(128, 3, 2)
    text.conv(256, 3, 2)
    text.route(-1, more="groups=4\ngroup_id=2\n")
    text.conv(64, 3, 2)
    text.head("3,4,5", _SIX, "linear", "scale_x_y = 1.05\n")
    return text.text()


PUBLISHED: dict[str, tuple[Callable[[tuple[int, int]], str], Sequence[int]]] = {
    "yolov4": (yolov4, (139, 150, 161)),
    "yolov4-tiny": (yolov4_tiny, (30, 37)),
    "yolov4-csp": (yolov4_csp, (144, 159, 174)),
    "yolov7-tiny": (yolov7_tiny, (90, 94, 98)),
    "swish": (swish, (5,)),
}
"""Each with the numbers of its heads' layers, as Darknet prints them for the published network."""
