"""Make any frame of a site, picture and truth together."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from standoff.core.types import ImageArray
from standoff_sim.camera.flight import blur_homography
from standoff_sim.clip.truth import IdArray, Row, entity_rows, frame_row, pair_rows
from standoff_sim.render import Renderer
from standoff_sim.scene.moment import EntityState, Moment, scene_at
from standoff_sim.scene.site import Site


@dataclass(frozen=True, slots=True, eq=False)
class RenderedFrame:
    """One frame and all that is true in it.

    Attributes:
        index: Of the frame.
        image: (H, W, 3) uint8 BGR, as the camera's sensor gives it.
        ids: (H, W) entity under each pixel, 0 for none.
        entities: Rows of `standoff.clips.TRUTH_SCHEMA`.
        pairs: Rows of `standoff.clips.PAIRS_SCHEMA`.
        frame: Row of `standoff.clips.CLIP_FRAMES_SCHEMA`.
    """

    index: int
    image: ImageArray
    ids: IdArray
    entities: list[Row]
    pairs: list[Row]
    frame: Row


class Studio:
    """A renderer with one site loaded; a context manager.

    Args:
        site: What to show.
        samples: Of multisample anti-aliasing.
    """

    def __init__(self, site: Site, samples: int = 4) -> None:
        self._site = site
        camera = site.scene.flight.view(0.0).camera
        self._renderer = Renderer((camera.width_px, camera.height_px), samples)
        self._renderer.load(site.scene.ground, site.scene.props)

    def __enter__(self) -> Studio:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def close(self) -> None:
        """Free the renderer."""
        self._renderer.release()

    def show(self, site: Site) -> None:
        """Show another site, or the same with another camera, in pictures of the same size."""
        earlier, self._site = self._site.scene, site
        if site.scene.ground is not earlier.ground or site.scene.props is not earlier.props:
            self._renderer.load(site.scene.ground, site.scene.props)

    def shoot(self, index: int, time_s: float, *, clean: bool = False) -> RenderedFrame:
        """Make one frame.

        Args:
            index: Of the frame; with the scene's seed it decides the noise.
            time_s: Of the scene.
            clean: Leave out motion blur and everything that the sensor adds.
        """
        scene, site = self._site.scene, self._site
        moment = scene_at(scene, time_s)
        blur = None if clean else blur_homography(scene.flight, time_s, site.shutter_s, 0.0)
        exposure = site.look.exposure * site.sensor.exposure_at(time_s)
        look = replace(site.look, exposure=exposure, blur=blur)
        rendered = self._renderer.render(moment.view, moment.batches, scene.light, look)
        image = rendered.image
        if not clean:
            image = site.sensor.expose(image, np.random.default_rng([scene.seed, 7919, index]))
        entities = entity_rows(index, moment, rendered.ids, lambda body: self._silhouette_px(moment, body))
        return RenderedFrame(
            index,
            image,
            rendered.ids,
            entities,
            pair_rows(index, moment),
            frame_row(index, moment, scene.reference, site.board_m, entities),
        )

    def _silhouette_px(self, moment: Moment, body: EntityState) -> int:
        return self._renderer.silhouette_px(moment.view, body.batches)
