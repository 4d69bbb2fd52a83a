"""Arrays inside a page: whole numbers of 16 bits in place of real ones, compressed, as text."""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

# Numbers are 1 to LEVELS; 0 stands for "no value".
LEVELS = 65535
LEVEL_OF_COMPRESSION = 4


@dataclass
class Arrays:
    """Arrays of a page, each a text of its own that the page unpacks when it needs it.

    Attributes:
        texts: Compressed bytes of each array, as base64.
    """

    texts: list[str] = field(default_factory=list)

    def add(self, values: NDArray[Any]) -> dict[str, Any]:
        """An array as it is: real numbers in single precision, whole numbers in 32 bits, truth values in one bit.

        Returns:
            What the page must know to unpack it.
        """
        if values.dtype == np.bool_:
            return self._entry(np.packbits(values, axis=-1, bitorder="little"), "bits", values.shape)
        kind = "float32" if np.issubdtype(values.dtype, np.floating) else "uint32"
        return self._entry(np.ascontiguousarray(values, np.dtype(kind).newbyteorder("<")), kind, values.shape)

    def add_series(self, values: NDArray[np.floating]) -> dict[str, Any]:
        """Numbers of the points at each frame, shape (frames, points), in 16 bits between their extremes.

        Stored are differences between frames, low bytes apart from high ones: these compress well.
        """
        finite = np.isfinite(values)
        low = float(values.min(where=finite, initial=np.inf)) if finite.any() else 0.0
        high = float(values.max(where=finite, initial=-np.inf)) if finite.any() else 0.0
        span = high - low if high > low else 1.0
        fraction = np.where(finite, (values.astype(np.float64) - low) / span, 0.0)
        levels = np.where(finite, np.round(1.0 + fraction * (LEVELS - 1)), 0.0).astype(np.uint16)
        levels[1:] -= levels[:-1].copy()
        apart = np.stack([levels & 0xFF, levels >> 8]).astype(np.uint8)
        return {**self._entry(apart, "series", values.shape), "low": low, "high": high, "span": span}

    def _entry(self, values: NDArray[Any], kind: str, shape: tuple[int, ...]) -> dict[str, Any]:
        packed = zlib.compress(values.tobytes(), LEVEL_OF_COMPRESSION)
        self.texts.append(base64.b64encode(packed).decode("ascii"))
        return {"text": len(self.texts) - 1, "kind": kind, "shape": list(shape)}
