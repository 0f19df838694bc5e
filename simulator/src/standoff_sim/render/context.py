"""The OpenGL context without a screen, and programs from the GLSL files beside this one."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import resources
from typing import Any

import numpy as np

from standoff.core.errors import MissingDependency

_OPENGL = 430
_GLSL = f"#version {_OPENGL}\n"


def open_context() -> Any:  # noqa: ANN401 - moderngl has no types
    """Return a new OpenGL context of at least version 4.3 on EGL.

    Raises:
        MissingDependency: moderngl, the EGL library or a driver is not installed.
    """
    try:
        import moderngl
    except ImportError:
        raise MissingDependency(
            expected="the Python package moderngl for the simulator's pictures",
            found="none",
            fix="run: pip install ./simulator",
        ) from None
    settings: dict[str, Any] = {"backend": "egl", "require": _OPENGL}
    try:
        return moderngl.create_context(standalone=True, **settings)
    except Exception as error:  # noqa: BLE001 - a missing library or driver is a plain Exception in glcontext
        raise MissingDependency(
            expected="OpenGL 4.3 through EGL for the simulator's pictures, with or without a graphics card",
            found=f"none that works ({error})",
            fix="on Debian or Ubuntu run: apt-get install libegl1 libgl1-mesa-dri",
        ) from None


def _source(names: tuple[str, ...]) -> str:
    folder = resources.files("standoff_sim.render") / "glsl"
    return _GLSL + "".join((folder / name).read_text(encoding="utf-8") for name in names)


def build_program(context: Any, vertex: tuple[str, ...], fragment: tuple[str, ...] = ()) -> Any:  # noqa: ANN401
    """Compile a program; each shader is the concatenation of the named files."""
    return context.program(vertex_shader=_source(vertex), fragment_shader=_source(fragment) if fragment else None)


def set_uniforms(program: Any, values: Mapping[str, object]) -> None:  # noqa: ANN401
    """Set uniforms, floats in arrays row by row; those that the compiler optimised away are left out."""
    for name, value in values.items():
        if name not in program:
            continue
        if isinstance(value, np.ndarray):
            columns = value.T if value.ndim == 2 and value.shape[0] == value.shape[1] else value
            program[name].write(np.ascontiguousarray(columns, dtype=np.float32).tobytes())
        else:
            program[name].value = value
