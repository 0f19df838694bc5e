"""What is true in any frame of a site, without its picture."""

from __future__ import annotations

import numpy as np

from standoff_sim.clip.truth import FrameTruth, entity_row, frame_row, pair_rows
from standoff_sim.scene.moment import scene_at
from standoff_sim.scene.occlusion import Outlines
from standoff_sim.scene.site import Site


class SiteTruth:
    """The counterpart of `Studio` that draws nothing.

    Args:
        site: Whose truth is asked for.
    """

    def __init__(self, site: Site) -> None:
        self._site = site
        self._outlines = Outlines(site.scene)

    def at(self, index: int, time_s: float) -> FrameTruth:
        """Return the rows of one frame; what shows is approximated as `standoff_sim.scene.occlusion` says.

        Args:
            index: Of the frame.
            time_s: Of the scene.
        """
        scene = self._site.scene
        moment = scene_at(scene, time_s)
        seen = self._outlines.sights(moment)
        feet_px = moment.view.project(np.array([body.centre_m for body, _ in seen]).reshape(-1, 3))
        entities = [
            entity_row(index, moment, body, sight, foot_px)
            for (body, sight), foot_px in zip(seen, feet_px, strict=True)
        ]
        frame = frame_row(index, moment, scene.reference, self._site.board_m, entities)
        return FrameTruth(index, entities, pair_rows(index, moment), frame)
