from __future__ import annotations

import re
from pathlib import Path

import pytest

from standoff.core.errors import ModelError
from standoff.training.darknet.cfg import parse_cfg, read_cfg
from standoff.training.darknet.layers import Convolutional, Maxpool, Route, Shortcut, Yolo

NET = "[net]\nwidth=64\nheight=32\nchannels=3\n"
HEAD = "[yolo]\nmask=1\nanchors=1,2, 3,4\nclasses=2\nnum=2\n"


def test_a_convolution_has_darknets_defaults_and_pads_half_its_size() -> None:
    cfg = parse_cfg(
        NET + "[convolutional]\n[convolutional]\nsize=5\npad=1\ngroups=2\nfilters=4\nactivation=leaky\n" + HEAD
    )
    bare, padded = cfg.layers[:2]
    assert bare == Convolutional(5, 1, 1, 1, 0, 1, False, "logistic")
    assert isinstance(padded, Convolutional)
    assert (padded.padding, padded.groups, padded.filters, padded.activation) == (2, 2, 4, "leaky")


def test_layer_numbers_may_be_relative_or_absolute() -> None:
    conv = "[convolutional]\nfilters=3\nactivation=linear\n"
    cfg = parse_cfg(NET + 3 * conv + "[shortcut]\nfrom=-2\n[route]\nlayers=-1, 0,-3\n" + HEAD)
    assert cfg.layers[3] == Shortcut(14, 1, "linear")
    assert cfg.layers[4] == Route(16, (3, 0, 1))


def test_maxpool_pads_one_less_than_its_size_in_all() -> None:
    layer = parse_cfg(NET + "[maxpool]\nsize=2\nstride=1\n" + HEAD).layers[0]
    assert layer == Maxpool(5, 2, 1, 1)


def test_a_head_takes_the_anchors_of_its_mask() -> None:
    head = parse_cfg(NET + HEAD + "scale_x_y = 1.05  # comment\n").layers[0]
    assert head == Yolo(5, ((3.0, 4.0),), 2, 1.05)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("[lstm]\n", r"a layer of convolutional, .* in \[lstm\] at line 5 of a\.cfg, found \[lstm\]"),
        ("[convolutional]\nactivation=gelu\n", r"an activation .* in \[convolutional\] at line 6 .*'gelu'"),
        ("[convolutional]\nsize=3x\n", r"numbers for 'size' in \[convolutional\] at line 6 .*'3x'"),
        ("[convolutional]\nsize=0\n", r"at least 1 for 'size' .* line 6 .*'0'"),
        ("[convolutional]\nsize=1.5\n", r"whole number .* line 6 .*'1\.5'"),
        ("[convolutional]\nsize=1,2\n", r"one number for 'size' .* line 6"),
        ("[convolutional]\ndilation=2\n", r"options that standoff understands .* line 6 .*'dilation'"),
        ("[convolutional]\nsize=inf\n", r"numbers of at most .* for 'size' .* line 6 .*'inf'"),
        ("[convolutional]\nsize=nan\n", r"numbers of at most .* for 'size' .* line 6 .*'nan'"),
        ("[convolutional]\n[route]\nlayers=-1\ngroups=2\ngroup_id=2\n", r"a group_id from 0 to 1 .*line 9 .*found 2"),
        (
            "[convolutional]\nactivation=linear\n[yolo]\nanchors=1,2\nclasses=2\nnew_coords=1\n",
            r"activation=logistic before new_coords=1, for layer 1, \[yolo\] at line 7 .*found activation=linear",
        ),
        ("[yolo]\nanchors=1,2\nclasses=2\nnew_coords=1\n", r"a convolution with .* for layer 0.*found none"),
        ("[route]\nlayers=-1\n", r"an earlier layer for 'layers' .* line 6 .*-1"),
        ("[route]\nlayers=7\n", r"an earlier layer for 'layers' .* line 6 .*7"),
        ("[route]\n", r"whole numbers for 'layers' .* line 5"),
        ("[dropout]\n[shortcut]\nfrom=-1,0\n", r"one layer for 'from' .* line 7"),
        ("[dropout]\nprobability=1\n", r"a probability .* line 5 .*found 1"),
        ("[maxpool]\nsize=4\nstride=4\n", r"a padding .* line 5 .*padding 3, size 4, stride 4"),
        ("[yolo]\nanchors=1,2,3\nnum=2\n", r"4 positive anchor sides \(num=2\) .* line 6 .*3 numbers"),
        ("[yolo]\nanchors=1,2\nmask=1\n", r"mask numbers from 0 to 0 .* line 7 .*\[1\]"),
        ("[yolo]\nanchors=1,2\nclasses=3\n", r"one number of classes, .* in a\.cfg, found 3, 2"),
        ("just words\n", r"option=value at line 5 of a\.cfg, found 'justwords'"),
    ],
)
def test_what_is_not_understood_is_refused_with_its_section_and_line(text: str, message: str) -> None:
    with pytest.raises(ModelError, match=message) as caught:
        parse_cfg(NET + text + HEAD, "a.cfg")
    assert "\n" not in str(caught.value)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", r"\[net\] first in a\.cfg, found no section"),
        (HEAD, r"\[net\] first in a\.cfg, found \[yolo\]"),
        (NET, r"found no \[yolo\] layer"),
    ],
)
def test_text_that_is_no_detector_is_refused(text: str, message: str) -> None:
    with pytest.raises(ModelError, match=message):
        parse_cfg(text, "a.cfg")


def test_a_missing_and_a_binary_file_are_refused_in_one_line(tmp_path: Path) -> None:
    with pytest.raises(ModelError, match=re.escape(str(tmp_path / "none.cfg"))):
        read_cfg(tmp_path / "none.cfg")
    (tmp_path / "binary.cfg").write_bytes(b"[net]\x00\x80")
    with pytest.raises(ModelError, match="a binary file"):
        read_cfg(tmp_path / "binary.cfg")


def test_comments_may_be_in_any_encoding(tmp_path: Path) -> None:
    expected = parse_cfg(f"{NET}{HEAD}")
    text = f"{NET}# Größe … in Pixel\n{HEAD}"
    for number, content in enumerate((text.encode("cp1252"), text.encode("utf-8"), text.encode("utf-8-sig"))):
        path = tmp_path / f"{number}.cfg"
        path.write_bytes(content)
        assert read_cfg(path).heads[0].anchors_px == expected.heads[0].anchors_px
    path.write_bytes(text.encode("utf-16"))
    with pytest.raises(ModelError, match=r"found UTF-16\. Save the file as UTF-8"):
        read_cfg(path)


def test_of_an_option_that_stands_twice_the_first_counts_as_in_darknet(
    tmp_path: Path, caplog: pytest.LogCaptureFixture
) -> None:
    path = tmp_path / "a.cfg"
    path.write_text("[net]\nbatch=1\nwidth=64\nbatch=64\nwidth=32\nheight=32\nheight = 32\n" + HEAD)
    cfg = read_cfg(path)
    assert (cfg.width_px, cfg.height_px) == (64, 32)
    assert [record.message for record in caplog.records] == [
        "a.cfg, line 4: 'batch' stands in [net] a second time; as in Darknet 1 of line 2 counts, not 64",
        "a.cfg, line 5: 'width' stands in [net] a second time; as in Darknet 64 of line 3 counts, not 32",
    ]


@pytest.mark.shared
def test_every_layer_of_the_shared_cfg_is_understood(shared_data: Path) -> None:
    cfg = read_cfg(shared_data / "weights" / "yolo-fastest-1.1-xl" / "yolo-fastest-1.1-xl.cfg")
    assert (len(cfg.layers), len(cfg.heads), cfg.width_px) == (131, 2, 320)
    assert cfg.heads[0].anchors_px == ((115.0, 73.0), (119.0, 199.0), (242.0, 238.0))


def test_a_head_may_give_ground_points_in_four_more_values_of_each_anchor() -> None:
    plain, pointed = (parse_cfg(NET + HEAD + option).heads[0] for option in ("", "ground_point=1\n"))
    assert (plain.has_point, pointed.has_point) == (False, True)
    assert pointed.values == plain.values + 4 == 5 + 2 + 4
    with pytest.raises(ModelError, match="all with a ground point or none"):
        parse_cfg(NET + HEAD + HEAD + "ground_point=1\n")
