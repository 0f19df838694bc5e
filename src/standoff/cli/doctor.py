"""`standoff doctor`: what is installed, what is missing and how to get it."""

from __future__ import annotations

import ctypes
import importlib.metadata
import os
import platform
from pathlib import Path
from typing import Annotated, Any, NamedTuple

import typer

_EXTRAS = {
    "train": ("torch", "onnx"),
    "serve": ("fastapi", "uvicorn", "paho-mqtt", "apprise", "prometheus-client", "structlog"),
    "sim": ("moderngl", "trimesh", "pycollada", "shapely", "mapbox-earcut"),
}
_IN_ITS_PLACE = {"onnxruntime": ("onnxruntime-gpu", "onnxruntime-openvino", "onnxruntime-directml")}
_PROVIDERS = {
    "CPUExecutionProvider": "part of onnxruntime",
    "CUDAExecutionProvider": "pip install onnxruntime-gpu (in place of onnxruntime)",
    "TensorrtExecutionProvider": "pip install onnxruntime-gpu and NVIDIA TensorRT",
    "OpenVINOExecutionProvider": "pip install onnxruntime-openvino (in place of onnxruntime)",
}


class Finding(NamedTuple):
    """One line of the examination."""

    topic: str
    name: str
    found: str
    needed: bool
    fix: str

    @property
    def ok(self) -> bool:
        """Whether it is there."""
        return bool(self.found)


def _packages() -> list[Finding]:
    needed: dict[str, str] = {}
    for requirement in importlib.metadata.requires("standoff") or []:
        name, _, marker = requirement.partition(";")
        if "extra" not in marker:
            plain = name
            for sign in "<>=!~ [(":
                plain = plain.split(sign)[0]
            needed[plain.strip()] = name.strip()
    findings = [
        Finding("package", name, _any_version(name), needed=True, fix=f"pip install '{requirement}'")
        for name, requirement in needed.items()
    ]
    for extra, names in _EXTRAS.items():
        findings += [
            Finding(f"extra {extra}", name, _version(name), needed=False, fix=f"pip install 'standoff[{extra}]'")
            for name in names
        ]
    return findings


def _version(distribution: str) -> str:
    try:
        return importlib.metadata.version(distribution)
    except importlib.metadata.PackageNotFoundError:
        return ""


def _any_version(name: str) -> str:
    """Return the version of a package, or of one that takes its place."""
    found = [(other, _version(other)) for other in (name, *_IN_ITS_PLACE.get(name, ()))]
    return next((version if other == name else f"{other} {version}" for other, version in found if version), "")


def _opencv_clash() -> list[Finding]:
    """Two OpenCV distributions overwrite each other's files; which one is imported is then chance."""
    others = [name for name in ("opencv-python", "opencv-contrib-python") if _version(name)]
    return [
        Finding("package", f"no {name} beside opencv-python-headless", "", needed=True, fix=f"pip uninstall {name}")
        for name in others
    ]


def _providers() -> list[Finding]:
    import onnxruntime

    available = onnxruntime.get_available_providers()
    return [
        Finding(
            "inference",
            name,
            "available" if name in available else "",
            needed=name == "CPUExecutionProvider",
            fix=fix,
        )
        for name, fix in _PROVIDERS.items()
    ]


def _encoders() -> list[Finding]:
    import av

    return [
        Finding(
            "video",
            f"{name} encoder",
            "available" if name in av.codecs_available else "",
            needed=name == "mpeg4",
            fix="pip install --force-reinstall av (its wheels bring FFmpeg)",
        )
        for name in ("libx264", "mpeg4")
    ]


def _opengl() -> list[Finding]:
    from standoff.cli.simulator import INSTALL
    from standoff.core.errors import MissingDependency

    found, fix = "", ""
    try:
        from standoff_sim.render.context import open_context

        context = open_context()
    except ImportError:
        fix = INSTALL
    except MissingDependency as error:
        fix = error.fix
    else:
        found = context.info["GL_RENDERER"]
        context.release()
    return [Finding("simulator", "OpenGL through EGL", found, needed=False, fix=fix)]


_TIME_ERROR = 5
_ADJTIMEX_BYTES = 256


def _clock() -> list[Finding]:
    """Ask the kernel whether something keeps the clock right: ages of pictures rest on it."""
    try:
        code = ctypes.CDLL(None, use_errno=True).adjtimex(ctypes.create_string_buffer(_ADJTIMEX_BYTES))
    except (OSError, AttributeError):
        code = -1
    found = "kept by NTP" if 0 <= code < _TIME_ERROR else ""
    fix = "run chrony or systemd-timesyncd: a sender's time is compared with this clock"
    return [Finding("live", "clock that is kept right", found, needed=False, fix=fix)]


def examine() -> list[Finding]:
    """Look at packages, inference providers, video encoders, OpenGL and the clock."""
    return [*_packages(), *_opencv_clash(), *_providers(), *_encoders(), *_opengl(), *_clock()]


def doctor(
    as_json: Annotated[bool, typer.Option("--json", help="Print JSON.")] = False,
) -> None:
    """Show what is installed, which inference providers there are, and how to get what is missing."""
    from standoff import __version__
    from standoff.cli.console import print_table, write_json

    findings = examine()
    broken = [finding for finding in findings if finding.needed and not finding.ok]
    machine: dict[str, Any] = {
        "standoff": __version__,
        "python": platform.python_version(),
        "system": platform.platform(),
        "cores": os.cpu_count(),
    }
    if as_json:
        rows = [finding._asdict() | {"ok": finding.ok} for finding in findings]
        write_json(machine | {"healthy": not broken, "findings": rows}, Path("-"))
    else:
        title = f"standoff {__version__}, Python {machine['python']}, {machine['system']}, {machine['cores']} cores"
        rows_text = [
            (f.topic, f.name, f.found or ("MISSING" if f.needed else "not installed"), "" if f.ok else f.fix)
            for f in findings
        ]
        print_table(title, ("", "what", "found", "how to get it"), rows_text, texts=4)
        typer.echo(f"{len(broken)} needed things are missing." if broken else "Everything that standoff needs is here.")
    raise typer.Exit(2 if broken else 0)
