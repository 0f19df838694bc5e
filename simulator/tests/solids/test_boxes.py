from __future__ import annotations

import numpy as np
import trimesh
from hypothesis import example, given
from hypothesis import strategies as st
from laws import examples

from standoff_sim.solids.mesh import Mesh, Surface, box

SIDE_M = st.floats(0.002, 60.0)


@examples(40)
@given(SIDE_M, SIDE_M, SIDE_M)
@example(1.0, 1.0, 1.0)
@example(0.003, 0.003, 2.5)
@example(40.0, 0.02, 3.0)
def test_a_box_is_what_trimesh_makes_of_it_to_the_last_bit(length_m: float, width_m: float, height_m: float) -> None:
    solid = trimesh.creation.box(extents=(length_m, width_m, height_m))
    solid.apply_translation((0.0, 0.0, height_m / 2))
    expected = Mesh.of(solid, (0.1, 0.2, 0.3), Surface.RUST)
    made = box((length_m, width_m, height_m), (0.1, 0.2, 0.3), Surface.RUST)
    for name in Mesh.__slots__:
        np.testing.assert_array_equal(getattr(made, name), getattr(expected, name))
        assert getattr(made, name).dtype == getattr(expected, name).dtype
