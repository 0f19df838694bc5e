"""Big things that sites have: accommodation, storage, machinery that stands still and barriers."""

from __future__ import annotations

from collections.abc import Mapping

from standoff_sim.props.cabins import make_cabin, make_cabin_block, make_toilet
from standoff_sim.props.containers import make_container, make_skip
from standoff_sim.props.crane import make_crane
from standoff_sim.props.fences import make_barriers, make_gate
from standoff_sim.props.prop import Prop
from standoff_sim.props.scaffold import make_scaffold, make_scaffold_tower
from standoff_sim.props.site_machines import (
    make_compressor,
    make_generator,
    make_lighting_mast,
    make_pump,
    make_silo,
)
from standoff_sim.props.tanks import make_tank
from standoff_sim.props.yard import make_cones, make_drums, make_edge_rail, make_signs

PLANT: Mapping[str, Prop] = {
    prop.name: prop
    for prop in (
        Prop("container", 6.4, make_container, 1.6),
        Prop("skip", 3.4, make_skip, 1.2),
        Prop("cabin", 3.8, make_cabin, 1.2),
        Prop("cabin_block", 7.9, make_cabin_block, 0.7),
        Prop("toilet", 2.2, make_toilet, 1.0),
        Prop("crane", 4.2, make_crane, 0.5),
        Prop("gate", 8.3, make_gate, 0.2),
        Prop("barriers", 5.4, make_barriers, 0.8),
        Prop("cones", 7.3, make_cones, 0.9),
        Prop("drums", 2.6, make_drums, 1.0),
        Prop("signs", 1.9, make_signs, 0.6),
        Prop("edge_rail", 6.2, make_edge_rail, 0.8),
        Prop("generator", 2.4, make_generator, 1.0),
        Prop("compressor", 2.5, make_compressor, 0.6),
        Prop("lighting_mast", 2.2, make_lighting_mast, 0.5),
        Prop("silo", 3.2, make_silo, 0.6),
        Prop("tank", 2.3, make_tank, 0.8),
        Prop("pump", 1.4, make_pump, 0.6),
        Prop("scaffold_tower", 2.0, make_scaffold_tower, 0.8),
        Prop("scaffold", 7.8, make_scaffold, 0.8),
    )
}
"""Every family by name; `crane` reaches over half the site, but only its foot keeps others away."""
