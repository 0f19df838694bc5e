"""Draws a scene through a camera: picture and entity ids, both through the same lens.

`renderer.py` calls the passes in order: shadow, ids and depth, ambient occlusion, colour, lens.
"""

from standoff_sim.render.look import Look
from standoff_sim.render.renderer import Cutout, Rendered, Renderer

__all__ = ["Cutout", "Look", "Rendered", "Renderer"]
