"""Arrays inside a page, quantised to at most 16 bits, compressed and encoded as text."""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

LEVEL_OF_COMPRESSION = 4


@dataclass
class Arrays:
    """Arrays of a page, each a separate text that the page unpacks on demand.

    Attributes:
        bits: Precision of a series, at most 16: its numbers become 1 to 2^bits - 1, and 0 stands for "no value".
        texts: Compressed bytes of each array, as base64.
    """

    bits: int = 16
    texts: list[str] = field(default_factory=list)

    def add(self, values: NDArray[Any]) -> dict[str, Any]:
        """Add an array, with 32 bits a number or one bit a boolean; return how to unpack it."""
        if values.dtype == np.bool_:
            return self._entry(np.packbits(values, axis=-1, bitorder="little"), "bits", values.shape)
        kind = "float32" if np.issubdtype(values.dtype, np.floating) else "uint32"
        return self._entry(np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")), kind, values.shape)

    def add_triangles(self, corners: NDArray[np.integer]) -> dict[str, Any]:
        """Add triangles in order of their first corners, shape (T, 3).

        Differences of first corners between triangles, and of other corners from the first, are stored.
        """
        apart = corners.astype(np.int64)
        apart[:, 1:] -= apart[:, :1]
        apart[1:, 0] -= corners[:-1, 0]
        return self._entry(apart.astype("<u4"), "triangles", corners.shape)

    def add_series(self, values: NDArray[np.floating]) -> dict[str, Any]:
        """Add point values at each frame, shape (frames, points), quantised between their extremes.

        Differences between frames and between consecutive points are stored, with the sign in the lowest bit and low
        and high bytes separated, which compresses well.
        """
        finite = np.isfinite(values)
        low = float(values.min(where=finite, initial=np.inf)) if finite.any() else 0.0
        high = float(values.max(where=finite, initial=-np.inf)) if finite.any() else 0.0
        step = (high - low if high > low else 1.0) / (2**self.bits - 2)
        above = np.where(finite, (values.astype(np.float64) - low) / step, 0.0)
        levels = np.where(finite, np.round(1.0 + above), 0.0).astype(np.uint16)
        levels[1:] -= levels[:-1].copy()
        levels[:, 1:] -= levels[:, :-1].copy()
        signed = levels.view(np.int16)
        folded = ((signed << 1) ^ (signed >> 15)).view(np.uint16)
        apart = np.stack([folded & 0xFF, folded >> 8]).astype(np.uint8)
        return {**self._entry(apart, "series", values.shape), "low": low, "high": high, "step": step}

    def _entry(self, values: NDArray[Any], kind: str, shape: tuple[int, ...]) -> dict[str, Any]:
        packed = zlib.compress(values.tobytes(), LEVEL_OF_COMPRESSION)
        self.texts.append(base64.b64encode(packed).decode("ascii"))
        return {"text": len(self.texts) - 1, "kind": kind, "shape": list(shape)}
