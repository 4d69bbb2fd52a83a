"""Masks of family members: bit k % 32 of word k // 32."""

from __future__ import annotations

import numpy as np

from ..kernels.families import WORD


def pack(mask: np.ndarray) -> np.ndarray:
    """Pack booleans, shape (..., n), into 32-bit words, uint32, shape (..., words)."""
    n = mask.shape[-1]
    words = -(-n // WORD)
    padded = np.zeros((*mask.shape[:-1], words * WORD), bool)
    padded[..., :n] = mask
    packed = np.packbits(padded, axis=-1, bitorder="little")
    return np.ascontiguousarray(packed).view("<u4").astype(np.uint32)


def unpack(words: np.ndarray, members: int) -> np.ndarray:
    """The inverse of `pack`."""
    as_bytes = np.ascontiguousarray(words.astype("<u4")).view(np.uint8)
    return np.unpackbits(as_bytes, axis=-1, bitorder="little")[..., :members].astype(bool)
