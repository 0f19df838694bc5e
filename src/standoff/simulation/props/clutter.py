"""All families of clutter, small and large, that a site is strewn with."""

from standoff.simulation.props.concrete_works import CONCRETE_WORKS
from standoff.simulation.props.debris import DEBRIS
from standoff.simulation.props.heaps import HEAPS
from standoff.simulation.props.loads import LOADS
from standoff.simulation.props.prop import Prop
from standoff.simulation.props.rebar import REBAR
from standoff.simulation.props.stacks import STACKS
from standoff.simulation.props.tools import TOOLS

CLUTTER: tuple[Prop, ...] = CONCRETE_WORKS + REBAR + STACKS + LOADS + HEAPS + DEBRIS + TOOLS
