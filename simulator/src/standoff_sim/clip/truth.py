"""What is true in one frame, as rows for the clip's tables.

Boxes follow `standoff.core.camera`: the centre of the top-left pixel is (0, 0), so the box of the pixels i .. j
goes from i - 0.5 to j + 0.5.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import lru_cache
from itertools import combinations
from typing import Any

import numpy as np
import numpy.typing as npt
import shapely
from scipy.spatial import ConvexHull, QhullError

from standoff.clips import TRUTH_NUMBERS
from standoff.core.classes import CLASSES, Role
from standoff.core.homography import FloatArray
from standoff.core.pose import View
from standoff_sim.scene.moment import EntityState, Moment
from standoff_sim.scene.scene import Batch, Reference
from standoff_sim.solids.mesh import Float32Array, Mesh

Row = dict[str, Any]
IdArray = npt.NDArray[np.uint16]


@dataclass(frozen=True, slots=True, eq=False)
class Sight:
    """How one entity shows in one picture.

    Attributes:
        box_px: (4,) around what is visible inside the picture; NaN when nothing is.
        full_px: (4,) around the whole, through everything in front and beyond the picture's edge; NaN when a part of
            it is behind the camera or outside the lens model.
        visible_px: Visible pixels.
        visible_share: Their share of the whole silhouette.
    """

    box_px: FloatArray
    full_px: FloatArray
    visible_px: int
    visible_share: float


@dataclass(frozen=True, slots=True, eq=False)
class FrameTruth:
    """All that is true in one frame.

    Attributes:
        index: Of the frame.
        entities: Rows of `TRUTH_SCHEMA`.
        pairs: Rows of `PAIRS_SCHEMA`.
        frame: Row of `CLIP_FRAMES_SCHEMA`.
    """

    index: int
    entities: list[Row]
    pairs: list[Row]
    frame: Row


@lru_cache(maxsize=4096)
def _hull_vertices(mesh: Mesh) -> Float32Array:
    """Return the vertices that can be on the outline of the mesh, from wherever it is seen."""
    try:
        return mesh.vertices_m[ConvexHull(mesh.vertices_m).vertices]
    except QhullError:
        return mesh.vertices_m


def outline_points_m(batches: Sequence[Batch]) -> FloatArray:
    """Return (N, 3) points whose bounding box in any picture is that of all the batches, site frame."""
    return np.concatenate(
        [
            (_hull_vertices(batch.mesh) @ pose[:3, :3].T + pose[:3, 3]).astype(np.float64)
            for batch in batches
            for pose in batch.poses
        ]
    )


def full_box_px(batches: Sequence[Batch], view: View) -> FloatArray:
    """Project everything, uncut by the picture's edge or by what is in front.

    Returns:
        (4,) x1, y1, x2, y2; NaN when a point is behind the camera or outside the lens model.
    """
    points_px = view.project(outline_points_m(batches))
    if not np.isfinite(points_px).all():
        return np.full(4, np.nan)
    return np.concatenate([points_px.min(axis=0), points_px.max(axis=0)])


def visible_boxes_px(ids: IdArray, count: int) -> tuple[FloatArray, npt.NDArray[np.int64]]:
    """Read boxes and sizes off the id picture.

    Args:
        ids: (H, W).
        count: Highest id.

    Returns:
        (count + 1, 4) boxes, NaN where nothing is visible, and (count + 1,) numbers of pixels; row k is id k.
    """
    boxes = np.full((count + 1, 4), np.nan)
    rows, columns = np.nonzero(ids)
    found = ids[rows, columns].astype(np.int64)
    sizes = np.bincount(found, minlength=count + 1)
    for entity in np.flatnonzero(sizes):
        own = found == entity
        y, x = rows[own], columns[own]
        boxes[entity] = x.min() - 0.5, y.min() - 0.5, x.max() + 0.5, y.max() + 0.5
    return boxes, sizes


def entity_rows(frame: int, moment: Moment, ids: IdArray, silhouette_px: Callable[[EntityState], int]) -> list[Row]:
    """Return the rows of `TRUTH_SCHEMA` for one frame: every body, and the parked vehicles that show.

    Args:
        frame: Its index.
        moment: The scene at its time.
        ids: (H, W) id picture.
        silhouette_px: Counts the pixels that a body alone would cover.
    """
    everybody = (*moment.bodies, *moment.parked)
    boxes, sizes = visible_boxes_px(ids, max((body.entity_id for body in everybody), default=0))
    shown = (*moment.bodies, *(body for body in moment.parked if sizes[body.entity_id]))
    rows = []
    for body in shown:
        visible_px = int(sizes[body.entity_id])
        whole_px = max(silhouette_px(body), visible_px) if visible_px else 0
        full_px = full_box_px(body.batches, moment.view)
        sight = Sight(boxes[body.entity_id], full_px, visible_px, visible_px / whole_px if whole_px else 0.0)
        rows.append(entity_row(frame, moment, body, sight, moment.view.project(body.centre_m[None])[0]))
    return rows


def entity_row(frame: int, moment: Moment, body: EntityState, sight: Sight, foot_px: FloatArray) -> Row:
    """Return one row of `TRUTH_SCHEMA`; `foot_px` (2,) is where the body's centre appears."""
    heading_deg = float(np.rad2deg(np.pi / 2 - body.heading_rad) % 360.0)
    numbers = [
        *body.centre_m, heading_deg, *body.velocity_mps, *body.tip_m, *sight.box_px, *sight.full_px,
        sight.visible_share, *foot_px,
    ]  # fmt: skip
    return {
        "frame": frame,
        "time_s": moment.time_s,
        "entity_id": body.entity_id,
        "class_id": body.class_id,
        "class_name": CLASSES[body.class_id].name,
        "visible_px": sight.visible_px,
        **dict(zip(TRUTH_NUMBERS, map(float, numbers), strict=True)),
        "footprint_x_m": body.footprint_m[:, 0].tolist(),
        "footprint_y_m": body.footprint_m[:, 1].tolist(),
    }


def pair_rows(frame: int, moment: Moment) -> list[Row]:
    """Return the rows of `PAIRS_SCHEMA` for one frame: every kind of distance between two entities, horizontal.

    The reference object and vehicles parked in the street keep no distance.
    """
    bodies = [body for body in moment.bodies if CLASSES[body.class_id].role is not Role.REFERENCE]
    outlines = {body.entity_id: shapely.Polygon(body.footprint_m) for body in bodies}
    return [
        {
            "frame": frame,
            "time_s": moment.time_s,
            "entity_a": first.entity_id,
            "entity_b": second.entity_id,
            "centre_m": float(np.linalg.norm(first.centre_m[:2] - second.centre_m[:2])),
            "footprint_m": float(outlines[first.entity_id].distance(outlines[second.entity_id])),
            "tip_m": _tip_distance_m(first, second),
        }
        for first, second in combinations(sorted(bodies, key=lambda body: body.entity_id), 2)
    ]


def _tip_distance_m(first: EntityState, second: EntityState) -> float:
    reaches = [
        float(np.linalg.norm(tool.tip_m[:2] - other.centre_m[:2]))
        for tool, other in ((first, second), (second, first))
        if np.isfinite(tool.tip_m).all()
    ]
    return min(reaches, default=float("nan"))


def frame_row(
    frame: int, moment: Moment, reference: Reference | None, board_m: FloatArray | None, entities: Sequence[Row]
) -> Row:
    """Return the row of `CLIP_FRAMES_SCHEMA` for one frame.

    Args:
        frame: Its index.
        moment: The scene at its time.
        reference: The reference object, if the scene has one.
        board_m: (N, 3) inner corners of the checkerboard, if the scene has one.
        entities: The frame's rows of the entities' table.
    """
    view = moment.view
    none = np.empty((0, 3))
    corners_px = {
        "reference_top": view.project(none if reference is None else reference.top_m),
        "reference_base": view.project(none if reference is None else reference.base_m),
        "board": view.project(none if board_m is None else board_m),
    }
    shares = [row["visible_share"] for row in entities if reference and row["entity_id"] == reference.entity_id]
    x_m, y_m, z_m = view.position_m.tolist()
    row: Row = {"frame": frame, "time_s": moment.time_s, "camera_x_m": x_m, "camera_y_m": y_m, "camera_z_m": z_m}
    row |= {"site_to_camera": view.site_to_camera.ravel().tolist()}
    row |= {f"{name}_{axis}_px": px[:, k].tolist() for name, px in corners_px.items() for k, axis in enumerate("xy")}
    row |= {"reference_covered": moment.reference_covered}
    row |= {"reference_visible_share": shares[0] if shares else float("nan")}
    return row


def mask_counts(ids: IdArray, entity_id: int) -> Mapping[str, Any]:
    """Return an entity's visible mask as COCO's uncompressed run lengths: column by column, background first."""
    mask = (ids == entity_id).ravel(order="F")
    changes = np.flatnonzero(np.diff(mask)) + 1
    edges = np.concatenate([[0], changes, [mask.size]])
    runs = np.diff(edges).tolist()
    return {"size": list(ids.shape), "counts": [0, *runs] if mask[0] else runs}
