"""The colour scale of a field, common to all panels of a picture and its colour bar."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from .picture_frames import Shown

# Perceptually uniform maps: of fields with one sign, of damage, and of fields with both signs (Moreland 2009).
ONE_SIGN, DAMAGE, BOTH_SIGNS = "viridis", "inferno_r", "coolwarm"
# Colour of places at which a field has no value, such as the damage of a joint where nothing is joined.
NO_VALUE = "0.72"
# A field has both signs if its smaller side is more than this fraction of its larger one.
SMALLER_SIDE = 0.02


@dataclass(frozen=True, eq=False)
class ColourScale:
    """Maps values of a field to colours.

    Attributes:
        name: Name of the Matplotlib colour map.
        low: Value of its first colour.
        high: Value of its last colour; low = -high for a diverging map.
        shown: Lowest and highest value on the colour bar.
        label: Label of the colour bar.
    """

    name: str
    low: float
    high: float
    shown: tuple[float, float]
    label: str

    def colours(self, values: np.ndarray) -> np.ndarray:
        """Red, green, blue and opacity of values, shape (..., 4)."""
        colours, norm = self._mapping()
        return np.asarray(colours(norm(values)))

    def add_bar(self, figure: Any, axes: Any, **options: Any) -> None:
        """Draw the colour bar beside `axes`, over the range `shown`."""
        from matplotlib.cm import ScalarMappable

        colours, norm = self._mapping()
        bar = figure.colorbar(ScalarMappable(norm, colours), ax=axes, label=self.label, **options)
        bar.ax.set_ylim(*self.shown)

    def _mapping(self) -> tuple[Any, Any]:
        from matplotlib import colormaps
        from matplotlib.colors import Normalize

        return colormaps[self.name].with_extremes(bad=NO_VALUE), Normalize(self.low, self.high)


def scale_of(frames: Sequence[Shown], field: str, label: str, limits: tuple[float, float] | None) -> ColourScale:
    """The scale of a field over all frames; `limits` are by default those of the field."""
    low, high = limits or _range(frames, field)
    if min(high, -low) > SMALLER_SIDE * max(high, -low):
        reach = max(high, -low)
        return ColourScale(BOTH_SIGNS, -reach, reach, (low, high), label)
    name = DAMAGE if field == "damage" else ONE_SIGN
    # Zero has one colour, whichever sign the field has.
    return ColourScale(f"{name}_r" if high <= 0.0 else name, low, high, (low, high), label)


def _range(frames: Sequence[Shown], field: str) -> tuple[float, float]:
    values = np.concatenate([f.fields[field][f.framed] for f in frames])
    values = values[np.isfinite(values)]
    low, high = float(values.min(initial=np.inf)), float(values.max(initial=-np.inf))
    return (low, high if high > low else low + 1.0) if len(values) else (0.0, 1.0)
