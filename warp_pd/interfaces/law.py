"""Force laws, and their tangents."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
import warp as wp

from ..device.context import Context
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families
from .built_part import BuiltPart


class Solve(Protocol):
    """Solves K x = b."""

    def __call__(self, b: np.ndarray) -> np.ndarray:
        """X of b, both of shape (N, 3)."""
        ...


class SparseTangent(Protocol):
    """A tangent as a sparse matrix on the host, for a direct factorisation."""

    def factorise(self) -> Solve | None:
        """Solver of K x = b on arrays of shape (N, 3); None if K is singular."""
        ...


class Tangent(Protocol):
    """How the internal force changes with the displacement, for Newton's method.

    Attributes:
        inverse_blocks: Inverse diagonal blocks of the stiffness, (N,) mat33 [m/N].
        direct_points: Up to so many points a factorisation on the host beats iterations on a GPU.
    """

    inverse_blocks: Array
    direct_points: int

    def add_linearise(self, stage: Stage, displacement: Array, tension: Array) -> None:
        """Add the launches that take the tangent at a displacement, with an isotropic tension [Pa] added."""
        ...

    def add_product(self, stage: Stage, direction: Array, change: Array) -> None:
        """Add the launches that fill `change` [N] with the change of the force along a direction [m]."""
        ...

    def is_slack(self) -> bool:
        """Whether the state just linearised has no stiffness against some displacement."""
        ...

    def modulus(self) -> float:
        """How stiff the sheet is [Pa], at the last linearisation."""
        ...

    def min_tension(self, relative: float) -> float:
        """Isotropic tension [Pa] that the tangent needs at least, at a relative residual."""
        ...

    def sparse(self) -> SparseTangent:
        """The tangent as a sparse matrix."""
        ...


class BuiltLaw(BuiltPart, Protocol):
    """A force law on a device.

    Attributes:
        weights: Weights in use, for the summary.
        has_energy: Whether its force is minus the gradient of an energy, or at least reports one.
        horizon: Horizon over the spacing of the sheet [-].
        families: The families on the host.
        struct: The families on the device, a Warp struct (kernels/families.py).
        intact: Bits of the intact bonds, (words, N) uint32, or None if nothing can break.
        constants: Constants of the material.
        inverse_horizon: [1/m].
        unit_volume: Thickness times reference area [m^3].
        correction: What a correction of the weights did, for the summary, or None.
        earlier_energy: Warp function of the energy of a family a moment ago; of laws with an energy.
        breaks_at_rest: Whether bonds of a sheet in static equilibrium may break under Newton's method.
        coarsens: Whether there is a law on coarser sheets.
    """

    weights: str
    has_energy: bool
    horizon: float
    families: Families
    struct: Any
    intact: Array | None
    constants: Any
    inverse_horizon: float
    unit_volume: float
    correction: dict[str, float] | None
    earlier_energy: wp.Function | None
    breaks_at_rest: bool
    coarsens: bool

    @property
    def strain_energy(self) -> Array | None:
        """Energy of each family [J] as of the last frame, (N,) float64; None without an energy."""
        ...

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        ...

    def bond_force(self) -> Array:
        """What the family of a point does to each of its pairs [N], (members, N) vec3, renewed with every force.

        Raises:
            InputError: for a law that does not keep it.
        """
        ...

    def fictitious_mass(self, stage: Stage) -> Array | None:
        """Add the launches that fill an array (N,) with a fictitious mass from the stiffness; None if it has none."""
        ...

    def tangent(self, context: Context, geometric: bool) -> Tangent:
        """The tangent for Newton's method.

        Args:
            context: Where to put arrays.
            geometric: Whether the tension of the sheet has its part in the stiffness.

        Raises:
            InputError: for a law without one.
        """
        ...

    def on_coarser(self, context: Context, horizon: float) -> BuiltLaw | None:
        """The law on a coarser sheet, with a horizon over its spacing, for multigrid; None if there is none."""
        return None

    def request_fields(self, names: Sequence[str]) -> None:
        """Let frames show further fields of the law.

        Raises:
            InputError: for names that it does not offer.
        """
        ...

    def fingerprint(self) -> str:
        """What functions of the user compute at fixed arguments, as a hash: a restart goes on with the same ones."""
        return ""

    def likely_cause(self) -> str:
        """What to suspect where a run in time diverged."""
        ...


@runtime_checkable
class Law(Protocol):
    """A force law: how displacements turn into forces. A frozen dataclass."""

    @property
    def material(self) -> Any:
        """The material."""
        ...

    @property
    def horizon(self) -> float:
        """Horizon over the spacing of the sheet [-]."""
        ...

    def compile_key(self, layout: str, breakable: bool) -> tuple[object, ...]:
        """What decides which kernels are compiled."""
        ...

    def build(self, context: Context) -> BuiltLaw:
        """Families, tables and kernels on a device."""
        ...
