"""Pictures of one split that look like pictures of another: a score on them says nothing.

Each picture becomes 255 bits: the signs, about their median, of the lowest 16 x 16 coefficients of the cosine transform
of its 64 x 64 grey miniature (perceptual hash, C. Zauner, "Implementation and Benchmarking of Perceptual Image Hash
Functions", 2010, section 3.2.1, with more bits). Two pictures are as different as their bits.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final

import cv2
import numpy as np
import numpy.typing as npt

from standoff.core.types import ImageArray
from standoff.labels.types import LabelledData, LabelledPicture, Split

MAX_BITS: Final = 70
"""Of 255, in which near-duplicates may differ: half-way between the two measured. A frame of a real flight and the
nearest other one of that flight differ in 2 to 52 bits (73 frames of six flights over streets), a picture and its copy
cut by 2 % on all sides in 26 to 48, moved by 2 % in 12 to 34. Pictures of two simulated scenes differ in 88 or more
(495,000 pairs), of two real flights in 98 or more, of two sheets of blank sand in 98 or more."""
_MIN_CONTRAST: Final = 3.0
"""Standard deviation of the miniature, grey levels. Plainer pictures have hashes of noise and rounding; the plainest
real aerial photograph or simulated picture measured has 8.6."""
_MINIATURE_PX, _COEFFICIENTS = 64, 16
_ROWS_AT_ONCE: Final = 256

_Words = npt.NDArray[np.uint64]


@dataclass(frozen=True, slots=True)
class NearDuplicate:
    """A picture to learn from and a picture to be scored on that look alike.

    Attributes:
        train: The one in `train`.
        held_out: The one in `split`.
        split: "val" or "test".
        bits: In which they differ, of 255.
    """

    train: Path
    held_out: Path
    split: Split
    bits: int


def near_duplicates(
    data: LabelledData,
    *,
    max_bits: int = MAX_BITS,
    on_picture: Callable[[], None] | None = None,
) -> Sequence[NearDuplicate]:
    """Find pictures of `val` and `test` that look like one of `train`.

    Args:
        data: Labelled pictures; those that cannot be decoded and plain ones (fog, blank sand) are passed over.
        max_bits: In which two pictures may differ to count as alike.
        on_picture: Called after each picture.

    Returns:
        For each held-out picture its most similar one of `train`; the most similar pairs first.
    """
    hashes = {split: _hash_all(pictures, on_picture) for split, pictures in data.splits.items()}
    train_paths, train_words = hashes["train"]
    found: list[NearDuplicate] = []
    for split in ("val", "test"):
        paths, words = hashes[split]
        if not paths or not train_paths:
            continue
        nearest, bits = _nearest(words, train_words)
        found += [
            NearDuplicate(train_paths[nearest[row]], paths[row], split, int(bits[row]))
            for row in np.flatnonzero(bits <= max_bits)
        ]
    return sorted(found, key=lambda pair: (pair.bits, pair.held_out))


def hash_picture(gray: ImageArray) -> _Words | None:
    """Return the 255 bits of an (H, W) grey picture as 4 words; None if it is too plain to tell."""
    miniature = cv2.resize(gray, (_MINIATURE_PX, _MINIATURE_PX), interpolation=cv2.INTER_AREA).astype(np.float32)
    if miniature.std() < _MIN_CONTRAST:
        return None
    lowest = cv2.dct(miniature)[:_COEFFICIENTS, :_COEFFICIENTS].ravel()
    # the first coefficient is the mean brightness, which says nothing of what is to be seen
    bits = lowest > np.median(lowest[1:])
    bits[0] = False
    return np.packbits(bits).view(np.uint64)


def _hash_all(pictures: Sequence[LabelledPicture], on_picture: Callable[[], None] | None) -> tuple[list[Path], _Words]:
    """Return the pictures that have a hash, and (N, 4) words."""
    paths: list[Path] = []
    words: list[_Words] = []
    for picture in pictures:
        gray = _read_small(picture.path)
        hashed = None if gray is None else hash_picture(gray)
        if hashed is not None:
            paths.append(picture.path)
            words.append(hashed)
        if on_picture is not None:
            on_picture()
    return paths, np.array(words, np.uint64).reshape(-1, _COEFFICIENTS**2 // 64)


def _read_small(path: Path) -> ImageArray | None:
    """Return a grey picture at a quarter of its size, decoded at that size from JPEG; None: not readable."""
    try:
        return cv2.imread(str(path), cv2.IMREAD_REDUCED_GRAYSCALE_4 | cv2.IMREAD_IGNORE_ORIENTATION)
    except cv2.error:
        # A quarter of fewer than four pixels is none.
        return None


def _nearest(words: _Words, among: _Words) -> tuple[npt.NDArray[np.intp], npt.NDArray[np.int64]]:
    """Return for each row the index of the nearest row of the others, and in how many bits they differ."""
    nearest, bits = [], []
    for start in range(0, len(words), _ROWS_AT_ONCE):
        block = words[start : start + _ROWS_AT_ONCE]
        differing = np.zeros((len(block), len(among)), np.int64)
        for word in range(words.shape[1]):
            differing += np.bitwise_count(block[:, word, None] ^ among[None, :, word])
        nearest.append(differing.argmin(axis=1))
        bits.append(differing.min(axis=1))
    return np.concatenate(nearest), np.concatenate(bits)
