"""Cut the ground points off a network's heads, which the network of ground points tells better.

    python drop_points.py RUN/network.cfg RUN/best.weights OUT

writes OUT.cfg and OUT.weights; boxes, scores and classes stay what they were.
"""

from __future__ import annotations

import re
import sys
from pathlib import Path

from torch import Tensor

from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.layers import POINT_VALUES
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import load_weights, save_weights

_ANCHORS = 3


def main() -> None:
    """Write both files."""
    cfg_path, weights_path, out = (Path(argument) for argument in sys.argv[1:])
    text = cfg_path.read_text(encoding="utf-8")
    pointed = DarknetNetwork(parse_cfg(text, cfg_path.name))
    load_weights(pointed, weights_path)
    values = 5 + int(re.findall(r"classes=(\d+)", text)[0])
    plain_text = without_points(text, values)
    plain = DarknetNetwork(parse_cfg(plain_text, out.name))
    for (_, source), (_, target) in zip(pointed.convolutions(), plain.convolutions(), strict=True):
        state = source.state_dict()
        target.load_state_dict({name: kept(state[name], own, values) for name, own in target.state_dict().items()})
    out.with_suffix(".cfg").write_text(plain_text, encoding="utf-8")
    save_weights(plain, out.with_suffix(".weights"))


def without_points(text: str, values: int) -> str:
    """Return a cfg whose heads give `values` numbers an anchor and no point."""
    sections = re.split(r"(?=^\[)", text.replace("ground_point=1\n", ""), flags=re.MULTILINE)
    wide, narrow = (f"filters={_ANCHORS * number}\n" for number in (values + POINT_VALUES, values))
    for place, after in enumerate(sections[1:]):
        if after.startswith("[yolo]"):
            sections[place] = sections[place].replace(wide, narrow)
    return "".join(sections)


def kept(source: Tensor, target: Tensor, values: int) -> Tensor:
    """Return a layer's numbers, of a head those that are no point."""
    if source.shape == target.shape:
        return source
    by_anchor = source.reshape(_ANCHORS, -1, *source.shape[1:])
    return by_anchor[:, :values].reshape(target.shape)


if __name__ == "__main__":
    main()
