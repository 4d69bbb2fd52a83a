"""Force laws, and their tangents."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
import warp as wp

from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families
from .built_part import BuiltPart
from .context import Context


class Solve(Protocol):
    """Solves K x = b."""

    def __call__(self, b: np.ndarray) -> np.ndarray:
        """Returns x for b, both of shape (N, 3)."""
        ...

    def negative(self) -> int | None:
        """Number of negative eigenvalues of K; None if the factors do not tell."""
        ...


class SparseTangent(Protocol):
    """A tangent as a sparse matrix on the host, for a direct factorisation.

    Attributes:
        free: Which components are free, shape (3 N,).
    """

    free: np.ndarray

    def matrix(self) -> Any:
        """K of the free components [N/m], a sparse matrix of SciPy."""
        ...

    def factorise(self) -> Solve | None:
        """Solver of K x = b on arrays of shape (N, 3); None if K is singular."""
        ...


class Tangent(Protocol):
    """The change of the internal force with the displacement, for Newton's method.

    Attributes:
        inverse_blocks: Inverse diagonal blocks of the stiffness, (N,) mat33 [m/N].
        direct_points: Number of points up to which a factorisation on the host is faster than iterations on a GPU.
    """

    inverse_blocks: Array
    direct_points: int

    def add_linearise(self, stage: Stage, displacement: Array, tension: Array) -> None:
        """Add the launches that compute the tangent at a displacement, with an isotropic tension [Pa] added."""
        ...

    def add_product(self, stage: Stage, direction: Array, change: Array) -> None:
        """Add the launches that fill `change` [N] with the change of the force along a direction [m]."""
        ...

    def is_slack(self) -> bool:
        """Whether the state of the last linearisation has no stiffness against some displacement."""
        ...

    def modulus(self) -> float:
        """Modulus of the sheet [Pa] at the last linearisation."""
        ...

    def min_tension(self, relative: float) -> float:
        """Minimum isotropic tension [Pa] that the tangent needs at a relative residual."""
        ...

    def sparse(self) -> SparseTangent:
        """The tangent as a sparse matrix."""
        ...


class BuiltLaw(BuiltPart, Protocol):
    """A force law on a device.

    Attributes:
        weights: Weights in use, for the summary.
        has_energy: Whether its force is minus the gradient of an energy, or at least reports one.
        horizon_ratio: Horizon in spacings of the sheet [-].
        families: The families on the host.
        struct: The families on the device, a Warp struct (kernels/families.py).
        intact: Bits of the intact bonds, (words, N) uint32, or None if bonds cannot break.
        constants: Constants of the material.
        inverse_horizon: [1/m].
        unit_volume: Thickness times reference area [m^3].
        correction: Report on a correction of the weights, for the summary, or None.
        earlier_energy: Warp function of the energy of a family a moment ago, for laws with an energy.
        coarsens: Whether there is a law on coarser sheets.
        goes_slack: Whether the material carries nothing in compression.
        slack_frequency: Bound on the frequencies of the fictitious mass in any state, for a law that is stiffer in
            other states than in the present one, as bonds of two moduli are; None for others.
    """

    weights: str
    has_energy: bool
    horizon_ratio: float
    families: Families
    struct: Any
    intact: Array | None
    constants: Any
    inverse_horizon: float
    unit_volume: float
    correction: dict[str, float] | None
    earlier_energy: wp.Function | None
    coarsens: bool
    goes_slack: bool
    slack_frequency: float | None

    @property
    def strain_energy(self) -> Array | None:
        """Energy of each family [J] as of the last frame, (N,) float64; None without an energy."""
        ...

    @property
    def force_path(self) -> str:
        """Name of the way in which it finds its force, for `plan`."""
        return "reference"

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        ...

    def screen_with_force(self, stage: Stage, squared_stretch: float, exceeding: Array) -> bool:
        """Add, if it has one, a launch of the force that also says which blocks of points have bonds to break.

        Args:
            stage: Stage in which bonds break.
            squared_stretch: Squared stretch |Y|^2/|X|^2 [-] up to which no bond breaks.
            exceeding: To fill with 1 where a bond ahead of a point of a block of SCREENED may break, and 0 elsewhere.

        Returns:
            Whether there is one.
        """
        return False

    def bond_force(self) -> Array:
        """Force of the family of a point on each of its pairs [N], (members, N) vec3, updated with every force.

        Raises:
            InputError: for a law that does not keep it.
        """
        ...

    def soften(self, damage: Array) -> None:
        """Let the family of each point lose stiffness by its damage, (N,); see kernels/damage_field.py.

        Raises:
            InputError: for a law that cannot.
        """
        ...

    def represented_areas(self) -> np.ndarray:
        """Area that the bonds of each point stand for [m^2], shape (N,)."""
        ...

    def energy_density(self, stretch: np.ndarray, across: Any = 1.0) -> np.ndarray:
        """Energy density [J/m^3] at stretches and stretches across them [-], which broadcast; in pure shear by default.

        Raises:
            InputError: for a law whose material has none.
        """
        ...

    def fictitious_mass(self, stage: Stage) -> Array | None:
        """Add the launches that fill an array (N,) with a fictitious mass from the stiffness; None if there is none."""
        ...

    def tangent(self, context: Context, geometric: bool) -> Tangent:
        """The tangent for Newton's method.

        Args:
            context: Takes the arrays.
            geometric: Whether the stiffness includes the tension of the sheet.

        Raises:
            InputError: for a law without one.
        """
        ...

    def on_coarser(self, context: Context, horizon: float) -> BuiltLaw | None:
        """The law on a coarser sheet, with a horizon in its spacings, for multigrid; None if there is none."""
        return None

    def request_fields(self, names: Sequence[str]) -> None:
        """Let frames show further fields of the law.

        Raises:
            InputError: for names that it does not offer.
        """
        ...

    def field_names(self) -> Sequence[str]:
        """Names of the fields that `request_fields` takes."""
        return ()

    def fingerprint(self) -> str:
        """Hash of the values of user functions at fixed arguments: a restart must use the same functions."""
        return ""

    def likely_cause(self, safety: float) -> str:
        """The likely cause if a dynamic run diverged, and a safety of the step to try."""
        ...


@runtime_checkable
class Law(Protocol):
    """A force law, which maps displacements to forces. A frozen dataclass."""

    @property
    def material(self) -> Any:
        """The material."""
        ...

    @property
    def horizon(self) -> float:
        """Horizon in spacings of the sheet [-]."""
        ...

    def build(self, context: Context) -> BuiltLaw:
        """Families, tables and kernels on a device."""
        ...
