"""Run the numeric tests as an older processor would: `make test-processors`.

numpy, OpenCV, numba, OpenBLAS, torch and the C library each choose code by what the processor can do, and round
differently then: a fused multiply-add rounds once, a wider register sums in another order. Here they are told to do
without, a step at a time. Each run is a new process, because all of them choose when they are loaded.
"""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Mapping

import cv2
import numpy as np

NUMERIC = (
    "tests/core",
    "tests/stages",
    "tests/evaluation",
    "tests/training/pictures",
    "tests/training/run/test_loss.py",
    "tests/monitor",
    "tests/test_drawn_site.py",
)
"""Whatever computes; what writes files, draws the simulator's pictures or trains for long is left out."""

_AVX512 = ("X86_V4", "AVX512")
"""How numpy's names for it begin."""
_SINGLE = dict.fromkeys(("OMP_NUM_THREADS", "OPENBLAS_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS"), "1")
"""Sums in threads are in another order."""
_AS_IN_2008 = {
    "OPENCV_IPP": "disabled",
    "OPENCV_LOG_LEVEL": "ERROR",  # otherwise it warns that IPP is disabled, among what tests read
    "NUMBA_CPU_NAME": "generic",
    "NUMBA_CPU_FEATURES": "",
    "OPENBLAS_CORETYPE": "Nehalem",
    "ATEN_CPU_CAPABILITY": "default",
    "ONEDNN_MAX_CPU_ISA": "SSE41",
    "GLIBC_TUNABLES": "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4,-AVX512F",
}


def numpy_features() -> tuple[str, ...]:
    """Return what numpy has code for, beyond what every processor can, and this one can do."""
    return tuple(np.show_config(mode="dicts")["SIMD Extensions"].get("found", ()))


def opencv_features() -> tuple[str, ...]:
    """Return the same for OpenCV, which marks with * what it chooses among and with ? what is not there."""
    words = cv2.getCPUFeaturesLine().split()
    return tuple(word.strip("*") for word in words if word.startswith("*") and not word.endswith("?"))


def processors() -> dict[str, Mapping[str, str]]:
    """Return the environment of each processor that this one can stand for."""
    ours, theirs = numpy_features(), opencv_features()
    newest = [name for name in ours if name.startswith(_AVX512)]
    found: dict[str, Mapping[str, str]] = {}
    if newest:
        found["without AVX-512"] = {
            "NPY_DISABLE_CPU_FEATURES": " ".join(newest),
            "OPENCV_CPU_DISABLE": ",".join(name for name in theirs if name.startswith("AVX512")),
            "NUMBA_CPU_NAME": "haswell",
            "OPENBLAS_CORETYPE": "Haswell",
            "ATEN_CPU_CAPABILITY": "avx2",
            "ONEDNN_MAX_CPU_ISA": "AVX2",
        }
    found["without AVX, AVX2 and FMA"] = {
        "NPY_DISABLE_CPU_FEATURES": " ".join(ours),
        "OPENCV_CPU_DISABLE": ",".join(theirs),
        **_AS_IN_2008,
    }
    return found


def main() -> int:
    """Run pytest once for each processor, with the arguments in place of the numeric tests; return 1 if any is red."""
    os.sched_setaffinity(0, {min(os.sched_getaffinity(0))})  # ONNX Runtime takes as many threads as there are cores
    red = []
    for name, changes in processors().items():
        settings = {key: value for key, value in {**_SINGLE, **changes}.items() if value or key == "NUMBA_CPU_FEATURES"}
        sys.stdout.write(f"As a processor {name}: " + " ".join(f"{k}={v!r}" for k, v in settings.items()) + "\n")
        sys.stdout.flush()
        words = [sys.executable, "-m", "pytest", "-q", *(sys.argv[1:] or NUMERIC)]
        if subprocess.run(words, env=os.environ | settings, check=False).returncode:
            red.append(name)
    sys.stdout.write("".join(f"red as a processor {name}\n" for name in red) or "green as any of these processors\n")
    return int(bool(red))


if __name__ == "__main__":
    sys.exit(main())
