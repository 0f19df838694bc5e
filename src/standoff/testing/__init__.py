"""Doubles for tests of what is built on standoff: they are real parts, told in advance what to say.

>>> from standoff.testing import FakeClock
>>> clock = FakeClock()
>>> clock.pass_s(1.5)
>>> clock.monotonic_s()
1.5
"""

from standoff.testing.doubles import DrawnFilm, FakeClock, MemorySink, ScriptedDetector

__all__ = ["DrawnFilm", "FakeClock", "MemorySink", "ScriptedDetector"]
