"""Tangents of force laws, for Newton's method."""

from __future__ import annotations

import functools
from typing import Any, NamedTuple, Protocol

import numpy as np

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array
from ..device.launches import Stage
from ..interfaces import BuiltLaw
from ..laws.bond_associated import BondAssociatedForce


class Solve(Protocol):
    """Solves K x = b."""

    def __call__(self, b: np.ndarray) -> np.ndarray:
        """Return x for b, both of shape (N, 3)."""
        ...

    def negative(self) -> int | None:
        """Number of negative eigenvalues of K; None if unknown."""
        ...


class SparseTangent(Protocol):
    """A tangent as a sparse matrix on the host, for a direct factorisation.

    Attributes:
        free: Mask of free components, shape (3 N,).
    """

    free: np.ndarray

    def matrix(self) -> Any:
        """K of the free components [N/m], a SciPy sparse matrix."""
        ...

    def factorise(self, added: np.ndarray | None = None) -> Solve | None:
        """Solver of K x = b on (N, 3) arrays; None if K is singular. `added`, (N, 3, 3): to its diagonal [N/m]."""
        ...


class Prediction(NamedTuple):
    """What predicts the stresses of a tangent: those at `base` and their linear change along `change`.

    In a thin sheet a step that turns it stretches it too, in second order, and that stress is far above those of
    bending. With it a tangent is too stiff for all later steps; with the predicted one the steps of slender bodies
    are few and may be long (Magisano, Leonetti and Garcea, Comput. Methods Appl. Mech. Eng. 313, 2017).

    Attributes:
        base: Displacement before the last step [m], (N,) vec3.
        change: Newton's whole step from there, also if a part of it was taken [m], (N,) vec3.
        tensile: 1 if principal stresses that are compressive count as zero, as after a step of which a part was
            taken: far from equilibrium the tangent is then not indefinite; otherwise 0, (1,).
    """

    base: Array
    change: Array
    tensile: Array


class Tangent(Protocol):
    """The derivative of the internal force by the displacement, for Newton's method.

    Attributes:
        inverse_blocks: Inverse diagonal blocks of the stiffness, (N,) mat33 [m/N].
        direct_points: Number of points up to which a factorisation on the host is faster than iterations on a GPU.
        symmetric: Whether products are symmetric; otherwise they are solved by GMRES, and the sparse matrix is one that
            preconditions them.
        can_predict: Whether stresses may be predicted.
        predicts: Whether Newton's steps take predicted ones: of a sheet that resists bending.
    """

    inverse_blocks: Array
    direct_points: int
    symmetric: bool = True
    can_predict: bool = False
    predicts: bool = False

    def add_linearise(
        self, stage: Stage, displacement: Array, tension: Array, inertia: Array | None = None,
        predicted: Prediction | None = None,
    ) -> None:  # fmt: skip
        """Add the launches that compute the tangent at a displacement.

        Args:
            stage: Stage to which they are added.
            displacement: The displacement [m], (N,) vec3.
            tension: An isotropic tension that is added [Pa].
            inertia: Stiffness of inertia and damping of each point in a time step [N/m], (N,); None in equilibrium.
            predicted: What predicts the stresses; None for those that are here.
        """
        ...

    def add_product(self, stage: Stage, direction: Array, change: Array) -> None:
        """Add the launches that fill `change` [N] with the derivative of the force along a direction [m]."""
        ...

    def add_turning(self, stage: Stage, direction: Array) -> Array | None:
        """Add the launch that finds the step along a direction [m] that turns the family of a point inside out, (N,).

        Return None, without a launch or an array, if families may turn inside out.
        """
        ...

    def is_slack(self) -> bool:
        """Whether the state of the last linearisation has no stiffness in some direction."""
        ...

    def modulus(self) -> float:
        """Size of the moduli of the sheet [Pa] at the last linearisation, to scale what is small beside them."""
        ...

    def mean_tension(self) -> float:
        """Mean tension of the sheet at the last linearisation [Pa], of laws that can be built on coarser sheets."""
        ...

    def min_tension(self, relative: float) -> float:
        """Minimum isotropic tension [Pa] that the tangent needs at a relative residual."""
        ...

    def sparse(self) -> SparseTangent:
        """The tangent as a sparse matrix."""
        ...


@functools.singledispatch
def tangent_of(law: BuiltLaw, context: Context, geometric: bool) -> Tangent:
    """Create the tangent of a force law; laws that have one register how it is made.

    Args:
        law: The built law.
        context: Where its arrays are declared.
        geometric: Whether the stiffness from the tension of the sheet is part of it.

    Raises:
        InputError: for a law without a tangent.
    """
    raise _refusal(law)


@tangent_of.register
def _(law: BondAssociatedForce, context: Context, geometric: bool) -> Tangent:
    """Refuses weights without an energy, a material without `response`, or `geometric` = False."""
    from .bond_associated_tangent import BondAssociatedTangent

    if not (law.law.has_tangent or law.steps_implicitly):
        raise _refusal(law)
    if law.weights == "published":
        raise InputError(
            "weights = 'published': expected 'plain' or 'corrected', which have an energy and so a tangent; or use the "
            "solver Explicit or Relaxation"
        )
    if not geometric:
        raise InputError("stiffness = 'constant': expected 'tangent'; only the law BondBased has 'constant'")
    return BondAssociatedTangent(law, context)


def _refusal(law: BuiltLaw) -> InputError:
    others = "Explicit" if getattr(law, "depends_on_time", False) else "Explicit or Relaxation"
    return InputError(
        f"force = {getattr(law, 'owner', type(law).__name__)}: expected BondAssociated, BondBased or Neural, which "
        f"have a tangent; or use the solver {others}"
    )
