"""The field register: every array of a simulation, declared once with its properties.

Restart files, the plan, the memory table, frames and halo exchange all use this register.
"""

from __future__ import annotations

import ctypes
import math
import weakref
from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any, TypeAlias

import numpy as np
import warp as wp

from .checks import InputError

Array: TypeAlias = "wp.array[Any]"

# What an array has an entry for; a "table" never changes, "once" is for single numbers and other data without entries.
PER = ("point", "bond", "face", "body", "block", "table", "once")


@dataclass(frozen=True)
class Field:
    """The declaration of an array.

    Attributes:
        per: What an entry belongs to, one of PER; "bond" means [members, points].
        restart: Whether restart files store it; such names are unique in a simulation.
        halo: Whether ghost points need it if several processes divide the points.
        own_exchange: Whether its owner keeps it valid in the whole halo.
        intermediate: Whether each step writes all of it before it is read.
        output: Unique name of the field in frames, or "" if it is not in frames.
        volume: Frames show it divided by this volume [m^3], a field or an array of the host, (N,); None to show it as
            it is.
    """

    name: str
    owner: str
    per: str = "point"
    restart: bool = False
    halo: bool = False
    own_exchange: bool = False
    intermediate: bool = False
    output: str = ""
    volume: Array | np.ndarray | None = None

    def __post_init__(self) -> None:
        if self.per not in PER:
            raise ValueError(f"per = {self.per!r}: expected one of {PER}")


@dataclass(frozen=True)
class Stored:
    """A declared field and its array."""

    field: Field
    array: Array

    @property
    def name(self) -> str:
        """Name of the field."""
        return self.field.name

    @property
    def owner(self) -> str:
        """The part that declared it."""
        return self.field.owner

    @property
    def nbytes(self) -> int:
        """Size in bytes."""
        return int(self.array.size) * int(wp.types.type_size_in_bytes(self.array.dtype))


@dataclass(eq=False)
class FieldRegister:
    """All fields of a simulation on one device, in the order of their allocation."""

    device: wp.Device
    stored: list[Stored] = field(default_factory=list)

    def __iter__(self) -> Iterator[Stored]:
        return iter(self.stored)

    def __getitem__(self, name: str) -> Array:
        """The first array of this name. Raises KeyError if no array has this name."""
        for stored in self.stored:
            if stored.name == name:
                return stored.array
        raise KeyError(name)

    def allocate(self, declared: Field, dtype: Any, values: Any = None, shape: Any = None) -> Array:
        """Allocate the array of a field, filled with `values` or with zeros of `shape`.

        Raises:
            ValueError: for a second restart field of the same name.
            InputError: if rows are too long, or the output name is already used.
        """
        if declared.restart and any(s.field.restart and s.name == declared.name for s in self.stored):
            raise ValueError(f"field {declared.name!r} already exists: expected a new name for a restart field")
        for other in (s for s in self.shown() if s.field.output == declared.output):
            raise InputError(
                f"{declared.owner}: output = {declared.output!r}: {other.owner} already has an output of this name; "
                "expected another one"
            )
        if values is None:
            array = wp.zeros(shape, dtype=dtype, device=self.device)
        else:
            array = wp.array(np.ascontiguousarray(values), dtype=dtype, device=self.device)
        _require_short_rows(declared, array)
        self.stored.append(Stored(declared, array))
        return array

    def in_restart(self) -> dict[str, Array]:
        """Arrays stored in restart files, by name."""
        return {s.name: s.array for s in self.stored if s.field.restart}

    def shown(self) -> list[Stored]:
        """Fields that frames show."""
        return [s for s in self.stored if s.field.output]

    @property
    def nbytes(self) -> int:
        """Bytes of all arrays."""
        return sum(s.nbytes for s in self.stored)


def _require_short_rows(declared: Field, array: Array) -> None:
    """Check the row length of an array, whose stride in bytes Warp stores in 32 bits."""
    if array.ndim > 1 and array.strides[0] >= 2**31:
        most = (2**31 - 1) // int(wp.types.type_size_in_bytes(array.dtype))
        raise InputError(
            f"{declared.owner}: {declared.name} has {array.shape[1]} entries in a row: expected at most {most}; "
            "divide the points among more processes (--gpus)"
        )


def on_cpu(array: Array) -> bool:
    """Whether an array is on a CPU."""
    return array.device is not None and bool(array.device.is_cpu)


def to_host(array: Array, points: np.ndarray | None = None) -> np.ndarray:
    """A copy on the host, in the precision of the device; `points` chooses entries of a one-dimensional array."""
    if points is not None:
        chosen: Array = wp.array(points, dtype=wp.int32, device=array.device)
        return np.asarray(wp.indexedarray(array, [chosen]).contiguous().numpy())
    # For an array on a GPU, numpy() is a copy already.
    return np.asarray(array.numpy().copy() if on_cpu(array) else array.numpy())


def host_shape(array: Array) -> tuple[int, ...]:
    """Shape of a copy on the host, with the components of vectors and matrices as last axes."""
    return (*array.shape, *getattr(array.dtype, "_shape_", ()))


def in_double(values: np.ndarray) -> np.ndarray:
    """Convert real numbers to float64; other types are unchanged."""
    return values.astype(np.float64, copy=False) if values.dtype.kind == "f" else values


# Views of arrays on a CPU. They do not keep their arrays alive, so none of them leaves this file.
_VIEWS: weakref.WeakKeyDictionary[Any, np.ndarray] = weakref.WeakKeyDictionary()


def _view(array: Array) -> np.ndarray:
    """The memory of an array on a CPU; `array.numpy()` takes ten times as long."""
    found = _VIEWS.get(array)
    if found is None:
        if not (array.ptr and array.is_contiguous):
            return np.asarray(array.numpy())
        scalar = getattr(array.dtype, "_wp_scalar_type_", array.dtype)
        shape, kind = host_shape(array), np.dtype(wp.dtype_to_numpy(scalar))
        memory = (ctypes.c_byte * (math.prod(shape) * kind.itemsize)).from_address(array.ptr)
        found = np.frombuffer(memory, kind).reshape(shape)
        _VIEWS[array] = found
    return found


def assign(array: Array, values: np.ndarray) -> None:
    """Copy host values into a device array, in the precision of the array."""
    if on_cpu(array):
        _view(array)[...] = values
        return
    scalar = getattr(array.dtype, "_wp_scalar_type_", array.dtype)
    array.assign(np.ascontiguousarray(values, dtype=wp.dtype_to_numpy(scalar)))


def copy(to: Array, source: Array) -> None:
    """Copy an array into another one of the same device, shape and type."""
    if on_cpu(to):
        _view(to)[...] = _view(source)
        return
    wp.copy(to, source)


def doubles(array: Array) -> np.ndarray:
    """A copy of real numbers on the host, as float64."""
    return np.array(_view(array) if on_cpu(array) else array.numpy(), dtype=np.float64)


def dot(a: Array, b: Array) -> float:
    """Scalar product of two (N,) vec3 arrays."""
    if on_cpu(a):
        # Not by BLAS: its idle threads would keep spinning on the cores that the kernels need.
        return float(np.einsum("i,i->", _view(a).reshape(-1), _view(b).reshape(-1), dtype=np.float64))
    return float(np.asarray(wp.utils.array_inner(a, b)))


def total(a: Array) -> float:
    """Sum of a scalar array."""
    return float(_view(a).sum()) if on_cpu(a) else float(np.asarray(wp.utils.array_sum(a)))
