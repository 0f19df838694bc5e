"""The command line: one typer app, one thin file for each verb, heavy imports inside the verbs.

Exit codes: 0 all well; 1 the run ended but its result is not complete (interrupted, an output failed,
nothing could be measured); 2 something that the operator must fix.
"""

from standoff.cli.app import app, main

__all__ = ["app", "main"]
