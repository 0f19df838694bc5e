"""How a film's frames are to be shown, by what its decoder says beside them."""

from __future__ import annotations

from typing import Final

import av
from av.sidedata.sidedata import Type

from standoff.files.orientation import Orientation

_KINDS_PYAV_MAY_NOT_KNOW: Final = range(28, 36)  # of libavutil/frame.h, AV_FRAME_DATA_LCEVC and on


def display_orientation(frame: av.VideoFrame) -> Orientation:
    """Return how a decoded frame is to be shown.

    Raises:
        ValueError: It is none of the eight ways; says what.
    """
    try:
        side_data = frame.side_data
    except ValueError:  # data of a kind that PyAV does not know, beside which it can read nothing else
        side_data = _with_known_data_only(frame).side_data
    matrix = side_data.get(Type.DISPLAYMATRIX)
    return Orientation() if matrix is None else Orientation.of_display_matrix(bytes(matrix))


def _with_known_data_only(frame: av.VideoFrame) -> av.VideoFrame:
    graph = av.filter.Graph()
    nodes = [
        graph.add_buffer(width=frame.width, height=frame.height, format=frame.format.name, time_base=frame.time_base),
        *(graph.add("sidedata", f"mode=delete:type={kind}") for kind in _KINDS_PYAV_MAY_NOT_KNOW),
        graph.add("buffersink"),
    ]
    graph.link_nodes(*nodes).configure()
    graph.push(frame)
    return graph.pull()
