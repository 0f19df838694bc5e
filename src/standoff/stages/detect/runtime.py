"""Open an ONNX model with ONNX Runtime on the processor that was asked for."""

from __future__ import annotations

import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Final

import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as runtime_errors

from standoff.core.errors import MissingDependency, ModelError
from standoff.stages.detect.params import Provider

_PROVIDERS: Final[dict[str, tuple[str, str]]] = {
    "cpu": ("CPUExecutionProvider", "onnxruntime"),
    "cuda": ("CUDAExecutionProvider", "onnxruntime-gpu"),
    "tensorrt": ("TensorrtExecutionProvider", "onnxruntime-gpu and NVIDIA TensorRT"),
    "openvino": ("OpenVINOExecutionProvider", "onnxruntime-openvino"),
}
_CHAINS: Final = {
    "cpu": ("cpu",),
    "cuda": ("cuda", "cpu"),
    "tensorrt": ("tensorrt", "cuda", "cpu"),
    "openvino": ("openvino", "cpu"),
}
"""Each provider, then those that take the operations that it does not know."""
_AUTO: Final = ("cuda", "cpu")
"""OpenVINO must be asked for: on some processors it computes in bfloat16 without saying so."""
_ERRORS_ONLY: Final = 3
ONNX_ERRORS: Final = (
    runtime_errors.EPFail,
    runtime_errors.Fail,
    runtime_errors.InvalidArgument,
    runtime_errors.InvalidGraph,
    runtime_errors.InvalidProtobuf,
    runtime_errors.NoModel,
    runtime_errors.NotImplemented,
    runtime_errors.RuntimeException,
)
"""What ONNX Runtime raises for a file or a picture that it cannot use."""


def available_providers() -> tuple[str, ...]:
    """Return the providers that the installed ONNX Runtime offers, by the names of `DetectParams.provider`."""
    installed = onnxruntime.get_available_providers()
    return tuple(name for name, (provider, _) in _PROVIDERS.items() if provider in installed)


def _missing(provider: str, found: str) -> MissingDependency:
    return MissingDependency(
        expected=f"the {provider} execution provider",
        found=found,
        fix=f"install {_PROVIDERS[provider][1]} in place of onnxruntime, or choose another provider",
    )


def _chosen(provider: Provider) -> str:
    available = available_providers()
    if provider == "auto":
        return next(name for name in _AUTO if name in available)
    if provider not in available:
        raise _missing(provider, f"only {', '.join(available)}")
    return provider


def open_session(path: Path, provider: Provider, intra_op_threads: int) -> onnxruntime.InferenceSession:
    """Load a model.

    Args:
        path: ONNX file.
        provider: What computes.
        intra_op_threads: Threads on the CPU; 0: as many as cores.

    Raises:
        ModelError: There is no such file, or it is not an ONNX model.
        MissingDependency: The provider is not installed, or is but does not start.
    """
    chosen = _chosen(provider)
    if not path.is_file():
        raise ModelError(expected=f"an ONNX model at {path}", found="no such file", fix="check the path")
    options = onnxruntime.SessionOptions()
    options.intra_op_num_threads = intra_op_threads
    options.log_severity_level = _ERRORS_ONLY
    names = [_PROVIDERS[name][0] for name in _CHAINS[chosen]]
    try:
        # Both print what is missing, to where a verb's JSON goes.
        with redirect_stdout(sys.stderr):
            if "cuda" in _CHAINS[chosen]:
                # CUDA's libraries from pip lie where the loader does not look.
                onnxruntime.preload_dlls()
            session = onnxruntime.InferenceSession(str(path), options, providers=names)
    except ONNX_ERRORS as error:
        raise ModelError(
            expected=f"an ONNX model at {path}",
            found=f"what ONNX Runtime cannot load ({str(error)[:120]})",
            fix="make the file with `standoff export`",
        ) from error
    if provider != "auto" and names[0] not in session.get_providers():
        raise _missing(provider, f"that it does not start and leaves {', '.join(session.get_providers())}")
    return session
