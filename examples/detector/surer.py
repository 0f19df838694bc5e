"""Make a network surer, or less sure, of all that it finds: its scores then mean what the tracker's settings expect.

    python surer.py RUN/network.cfg RUN/best.weights 0.4 OUT.weights

adds so much to the logit of every head's objectness. Which boxes are surer than which stays what it was, and so does
every average precision.
"""

from __future__ import annotations

import sys
from pathlib import Path

import torch

from standoff.training.darknet.cfg import read_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import load_weights, save_weights
from standoff.training.start.initial_weights import head_convolutions

_OBJECTNESS = 4


def main() -> None:
    """Write the weights."""
    cfg_path, weights_path, more, out = sys.argv[1:]
    network = DarknetNetwork(read_cfg(Path(cfg_path)))
    header = load_weights(network, Path(weights_path))
    heads = head_convolutions(network)
    with torch.no_grad():
        for index, convolution in network.convolutions():
            if index in heads:
                bias = convolution.convolution.bias
                assert bias is not None, "heads have no normalisation"
                bias.view(-1, heads[index].values)[:, _OBJECTNESS] += float(more)
    save_weights(network, Path(out), header)


if __name__ == "__main__":
    main()
