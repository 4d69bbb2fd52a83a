"""Point fields of frames in the types that files store."""

from __future__ import annotations

from collections.abc import Collection
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..device.checks import InputError
from ..interfaces.frame import Frame

TAKEN = ("displacement", "velocity", "damage", "reference_position")


class FrameFields(dict[str, NDArray[Any]]):
    """Fields by name, with a one-line error for a missing name."""

    def __missing__(self, name: str) -> NDArray[Any]:
        """Raise the error for a field that the frames do not have."""
        raise InputError(f"field {name!r}: the frames hold {', '.join(self)}; expected one of these")


def point_fields(frame: Frame, chosen: Collection[str] | None = None) -> dict[str, NDArray[Any]]:
    """Point data of a frame by name, in the types of the file; `chosen` besides the displacement, None for all."""
    fields = {"displacement": frame.displacement, "velocity": frame.velocity}
    if frame.damage is not None:
        fields["damage"] = frame.damage
    for name, values in frame.point_data.items():
        if name in TAKEN or not name or "/" in name or name == ".":
            raise ValueError(f"point_data has a field '{name}'; expected any other name, without '/'")
        if np.shape(values)[1:] not in ((), (3,)):
            raise ValueError(f"point_data['{name}'] has shape {np.shape(values)}; expected (N,) or (N, 3)")
        fields[name] = values
    kept = fields if chosen is None else {name: fields[name] for name in fields if name in {"displacement", *chosen}}
    return {name: stored(np.asarray(values)) for name, values in kept.items()}


def stored(values: NDArray[Any]) -> NDArray[Any]:
    """Convert real numbers to single precision, and booleans, which VTK lacks, to 0 and 1."""
    if values.dtype == np.bool_:
        return values.astype(np.uint8)
    return values if np.issubdtype(values.dtype, np.integer) else values.astype(np.float32, copy=False)


def same_arrays(a: NDArray[Any] | None, b: NDArray[Any] | None) -> bool:
    """Whether two arrays, or None, are equal."""
    return a is b or (a is not None and b is not None and np.array_equal(a, b))


def plain_value(value: Any) -> Any:
    """Convert a NumPy number to a Python number."""
    return value.item() if isinstance(value, np.generic) else value
