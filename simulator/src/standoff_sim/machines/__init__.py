"""Construction machines, each a `standoff_sim.scene.scene.Model`: procedural, articulated, no two quite alike.

One file per machine with its `make_...(rng)`; `machine_parts` are what they share, `paint` their colours.
"""
