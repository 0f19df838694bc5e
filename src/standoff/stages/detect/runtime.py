"""Open an ONNX model with ONNX Runtime on the processor that was asked for."""

from __future__ import annotations

import re
import sys
from contextlib import redirect_stdout
from pathlib import Path
from typing import Final

import onnxruntime
from onnxruntime.capi import onnxruntime_pybind11_state as runtime_errors

from standoff.core.errors import MissingDependency, ModelError
from standoff.files.lfs import refuse_pointer
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
_LONGEST_REASON: Final = 160
_ZIP: Final = b"PK\x03\x04"
"""PyTorch's checkpoints begin so, as all ZIP files do."""
_TORCH_SUFFIXES: Final = (".pt", ".pth")
_DARKNET_SUFFIX: Final = ".weights"
# Its telemetry too where somebody else loaded it first, and of what it has to say only errors.
onnxruntime.disable_telemetry_events()
onnxruntime.set_default_logger_severity(_ERRORS_ONLY)
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


def _refuse_others(path: Path) -> None:
    """Refuse what is known not to be an ONNX model, with what it is."""
    expected = f"an ONNX model at {path}"
    if not path.is_file():
        raise ModelError(expected=expected, found="no such file", fix="check the path")
    refuse_pointer(path, expected, ModelError)
    try:
        with path.open("rb") as file:
            beginning = file.read(len(_ZIP))
    except OSError as error:
        raise ModelError(expected=expected, found=error.strerror or "no file", fix="check its permissions") from error
    if beginning == _ZIP or path.suffix in _TORCH_SUFFIXES:
        raise ModelError(
            expected=expected,
            found="a checkpoint of PyTorch, or another archive",
            fix="export it to ONNX with the program that trained it (Ultralytics: `yolo export model=FILE.pt "
            "format=onnx`) and give that file; it says itself how it is read",
        )
    if path.suffix == _DARKNET_SUFFIX:
        fix = "make an ONNX file of it: `standoff export --cfg FILE.cfg --weights FILE.weights --names FILE.names`"
        raise ModelError(expected=expected, found="weights of Darknet", fix=fix)


def _read_all_names(session: onnxruntime.InferenceSession) -> None:
    """Read what ONNX Runtime decodes only when it is asked for.

    Raises:
        UnicodeDecodeError: It is damaged.
    """
    session.get_modelmeta().custom_metadata_map  # noqa: B018
    for node in (*session.get_inputs(), *session.get_outputs()):
        node.name, node.shape, node.type  # noqa: B018


def told_by_runtime(error: Exception) -> str:
    """Return what ONNX Runtime says is wrong, in one line, without its codes and without the path of the file.

    >>> told_by_runtime(ValueError("[ONNXRuntimeError] : 1 : FAIL : Load model from /a/b.onnx failed:Unknown opset 99"))
    'Unknown opset 99'
    """
    text = " ".join(str(error).split())
    return re.sub(r"^\[ONNXRuntimeError\] : \d+ : \w+ : |Load model from .*? failed: ?", "", text)[:_LONGEST_REASON]


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
    _refuse_others(path)
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
            # What starts on no other provider than the CPU has nothing to fall back to, and would say so in print.
            session = onnxruntime.InferenceSession(
                str(path), options, providers=names, enable_fallback=int(chosen != "cpu")
            )
        _read_all_names(session)
    except ONNX_ERRORS as error:
        raise ModelError(
            expected=f"an ONNX model at {path}",
            found=f"what ONNX Runtime {onnxruntime.__version__} cannot load ({told_by_runtime(error)})",
            fix="copy the file again; or export it again, with an older opset if it asks for a newer one",
        ) from error
    except UnicodeDecodeError as error:
        raise ModelError(
            expected=f"an ONNX model at {path}",
            found="names or metadata in it that are not UTF-8",
            fix="copy the file again, or export it again",
        ) from error
    if provider != "auto" and names[0] not in session.get_providers():
        raise _missing(provider, f"that it does not start and leaves {', '.join(session.get_providers())}")
    return session
