"""Memory of a run: freed blocks are kept, and where there is too little, advice says which batch would fit."""

from __future__ import annotations

import ctypes
import sys
import traceback
from collections.abc import Callable, Generator
from contextlib import contextmanager

import torch

from standoff.core.errors import ConfigError

_TRIM_THRESHOLD, _MMAP_THRESHOLD = -1, -3
"""Of `mallopt`, as in glibc's malloc.h."""
_NEVER = 2**31 - 1


def keep_freed_memory() -> None:
    """Let glibc keep large blocks that were freed, for the next step, instead of giving each back to the system.

    A step on a CPU takes and frees hundreds of blocks of up to 200 MB. Fresh from the system each, they have to be
    cleared page by page: EfficientNet-lite0 at 640x384 with 16 pictures took 7.0 s of CPU time a step, and 2.3 s so.
    Elsewhere than on Linux with glibc nothing happens.
    """
    if not sys.platform.startswith("linux"):
        return
    try:
        mallopt = ctypes.CDLL(None).mallopt
    except AttributeError:  # another C library
        return
    for what in (_MMAP_THRESHOLD, _TRIM_THRESHOLD):
        mallopt(what, _NEVER)


def is_out_of_memory(error: BaseException) -> bool:
    """Tell whether an allocation failed: on a GPU, in torch's CPU allocator, or in Python itself.

    >>> is_out_of_memory(MemoryError()), is_out_of_memory(RuntimeError("shapes do not fit"))
    (True, False)
    """
    if isinstance(error, (MemoryError, torch.OutOfMemoryError)):
        return True
    return isinstance(error, RuntimeError) and "can't allocate memory" in str(error)


@contextmanager
def saying_what_fits(batch: int, accumulate: int, attempt: Callable[[int], None]) -> Generator[None, None, None]:
    """Turn a failed allocation into advice.

    Args:
        batch: Pictures at once that may be too many.
        accumulate: Batches of one step.
        attempt: Goes through a step with so many pictures, or runs out of memory.

    Raises:
        ConfigError: Memory ran out; says the largest halving of the batch that fits.
    """
    try:
        yield
        return
    except (MemoryError, RuntimeError) as error:
        if not is_out_of_memory(error):
            raise
        cause = error
    # What the failed step had computed is still in its frames, and would leave less room for a smaller one.
    traceback.clear_frames(cause.__traceback__)
    smaller = batch // 2
    while smaller and not _fits(attempt, smaller):
        smaller //= 2
    fix = (
        f"set batch to {smaller}, which fits, and accumulate to {-(-batch * accumulate // smaller)} for the same step"
        if smaller
        else "take a smaller size_px or network: not even one picture fits"
    )
    raise ConfigError(expected=f"memory for {batch} pictures at once", found="too little", fix=fix) from cause


def _fits(attempt: Callable[[int], None], pictures: int) -> bool:
    if torch.cuda.is_available():
        torch.cuda.empty_cache()
    try:
        attempt(pictures)
    except (MemoryError, RuntimeError) as error:
        if is_out_of_memory(error):
            return False
        raise
    return True
