"""All families of clutter, small and large, that a site is strewn with."""

from standoff_sim.props.concrete_works import CONCRETE_WORKS
from standoff_sim.props.debris import DEBRIS
from standoff_sim.props.heaps import HEAPS
from standoff_sim.props.loads import LOADS
from standoff_sim.props.prop import Prop
from standoff_sim.props.rebar import REBAR
from standoff_sim.props.stacks import STACKS
from standoff_sim.props.tools import TOOLS

CLUTTER: tuple[Prop, ...] = CONCRETE_WORKS + REBAR + STACKS + LOADS + HEAPS + DEBRIS + TOOLS
