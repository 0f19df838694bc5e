from __future__ import annotations

from pathlib import Path

import yaml
from cli.calling import Call
from cli.test_cli import make_video


def test_a_run_warns_of_a_lens_whose_axis_is_far_from_the_middle(call: Call, site: Path, tmp_path: Path) -> None:
    stated = {"width_px": 320, "height_px": 240, "fx": 300.0, "fy": 300.0, "cx": 120.0, "cy": 119.5}
    (camera := tmp_path / "camera.yaml").write_text(yaml.safe_dump(stated))
    video = make_video(tmp_path / "site.mp4", 3)
    _, _, err = call("run", video, "--config", site, "--camera", camera, "--out", tmp_path / "out", "-q")
    assert err.count("the lens's axis is at 120, 120 of 320x240") == 1
