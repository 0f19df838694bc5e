from __future__ import annotations

import numpy as np
import pytest
import trimesh
from tolerances import GEOMETRY_REL

from standoff_sim.solids.shading import shade

_BENT = trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [1, 1, 0], [0, 1, 1]], [[0, 1, 2], [0, 2, 3]])
_SOLIDS = {
    "box": trimesh.creation.box((3.0, 2.0, 0.1)),
    "thick cylinder": trimesh.creation.cylinder(radius=1.0, height=0.3, sections=16),
    "thin bar": trimesh.creation.cylinder(radius=0.02, height=4.0, sections=8),
    "two bars": trimesh.util.concatenate(
        [trimesh.creation.cylinder(radius=0.1, segment=[[0, 0, 0], [i, 1, 2]], sections=8) for i in (1, 5)]
    ),
    "ball": trimesh.creation.icosphere(subdivisions=2),
    "cone": trimesh.creation.cone(radius=1.0, height=2.0, sections=12),
    "one face": trimesh.Trimesh([[0, 0, 0], [1, 0, 0], [0, 1, 0]], [[0, 1, 2]]),
    "two faces at a corner": _BENT,
    "a face without an area beside one with": trimesh.Trimesh(
        [[0, 0, 0], [1, 0, 0], [0, 1, 0], [2, 0, 0]], [[0, 1, 2], [0, 3, 1]], process=False
    ),
}


@pytest.mark.parametrize("crease_deg", [1.0, 35.0, 60.0])
@pytest.mark.parametrize("name", _SOLIDS)
def test_solids_are_shaded_as_trimesh_shades_them(name: str, crease_deg: float) -> None:
    solid = _SOLIDS[name]
    theirs = trimesh.graph.smooth_shade(solid.copy(), angle=np.deg2rad(crease_deg))
    vertices_m, normals, faces = shade(np.asarray(solid.vertices), np.asarray(solid.faces), crease_deg)
    np.testing.assert_array_equal(vertices_m, theirs.vertices)
    np.testing.assert_allclose(normals, theirs.vertex_normals, rtol=0.0, atol=GEOMETRY_REL)
    # the order of faces within a patch is trimesh's own and depends on the processor
    assert sorted(map(tuple, faces.tolist())) == sorted(map(tuple, theirs.faces.tolist()))
