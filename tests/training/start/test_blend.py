from __future__ import annotations

from pathlib import Path

import pytest
import torch
from training.small_runs import CFG

from standoff.core.errors import ConfigError, ModelError
from standoff.training.darknet.cfg import parse_cfg
from standoff.training.darknet.network import DarknetNetwork
from standoff.training.darknet.weights import WeightsHeader, load_weights, save_weights
from standoff.training.start.blend import blend_weights
from standoff.training.start.initial_weights import initialize_layers
from standoff.training.start.transfer import transfer_weights


def write_weights(folder: Path, name: str, seed: int, seen: int = 0) -> tuple[Path, DarknetNetwork]:
    (folder / "small.cfg").write_text(CFG)
    network = DarknetNetwork(parse_cfg(CFG, "small.cfg"))
    layers = [index for index, _ in network.convolutions()]
    initialize_layers(network, layers, torch.Generator().manual_seed(seed))
    save_weights(network, folder / name, WeightsHeader(seen=seen))
    return folder / name, network


def _read(folder: Path, name: str) -> tuple[DarknetNetwork, WeightsHeader]:
    network = DarknetNetwork(parse_cfg(CFG, "small.cfg"))
    return network, load_weights(network, folder / name)


def test_a_cut_file_is_the_head_of_the_whole_one(tmp_path: Path) -> None:
    (path, network), cfg = write_weights(tmp_path, "a.weights", 1), tmp_path / "small.cfg"
    convolutions = [index for index, _ in network.convolutions()]
    blend_weights(cfg, [(path, 1.0)], tmp_path / "cut.weights", convolutions[1])
    cut = (tmp_path / "cut.weights").read_bytes()
    assert path.read_bytes().startswith(cut)
    other, _ = write_weights(tmp_path, "b.weights", 2)[1], None
    transferred = transfer_weights(other, tmp_path / "cut.weights", cfg)
    assert transferred.copied == tuple(convolutions[:1])
    with pytest.raises(ConfigError, match="fewer layers than"):
        blend_weights(cfg, [(path, 1.0)], tmp_path / "cut.weights", len(network.cfg.layers))


@pytest.mark.parametrize("share", [0.0, 0.3, 1.0])
def test_a_blend_lies_on_the_straight_line(tmp_path: Path, share: float) -> None:
    (first, start), (second, end) = (
        write_weights(tmp_path, "a.weights", 1, seen=7),
        write_weights(tmp_path, "b.weights", 2, seen=90),
    )
    blend_weights(tmp_path / "small.cfg", [(first, 1 - share), (second, share)], tmp_path / "c.weights")
    blended, header = _read(tmp_path, "c.weights")
    assert header.seen == 90
    for (name, value), then, later in zip(
        blended.state_dict().items(), start.state_dict().values(), end.state_dict().values(), strict=True
    ):
        if value.is_floating_point():
            torch.testing.assert_close(value, torch.lerp(then, later, share), msg=name)


def test_several_blend_whatever_their_order(tmp_path: Path) -> None:
    files = [write_weights(tmp_path, f"{seed}.weights", seed)[0] for seed in range(3)]
    parts = list(zip(files, (0.5, 0.25, 0.25), strict=True))
    for name, order in (("x", parts), ("y", parts[::-1])):
        blend_weights(tmp_path / "small.cfg", order, tmp_path / f"{name}.weights")
    assert (tmp_path / "x.weights").read_bytes() == (tmp_path / "y.weights").read_bytes()


@pytest.mark.parametrize("shares", [(0.5, 0.4), (1.5, -0.5), ()])
def test_shares_that_are_none_are_refused(tmp_path: Path, shares: tuple[float, ...]) -> None:
    file, _ = write_weights(tmp_path, "a.weights", 1)
    with pytest.raises(ConfigError, match="add up to 1"):
        blend_weights(tmp_path / "small.cfg", [(file, share) for share in shares], tmp_path / "c.weights")
    assert not (tmp_path / "c.weights").exists()


def test_weights_of_another_network_are_refused(tmp_path: Path) -> None:
    file, _ = write_weights(tmp_path, "a.weights", 1)
    file.write_bytes(file.read_bytes()[:-400])
    with pytest.raises(ModelError):
        blend_weights(tmp_path / "small.cfg", [(file, 1.0)], tmp_path / "c.weights")
