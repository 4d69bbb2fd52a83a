"""Tangent of the neural law, whose force has no potential and may come from any network."""

from __future__ import annotations

from ...context import Context
from ...device.checks import InputError
from ...device.fields import Array
from ...device.launches import Stage
from ...kernels.papers.differences import differences
from ...laws.bond_associated import BondAssociated, BondAssociatedForce
from ...laws.family_law import FamilyLaw
from ...statics.tangent import BondAssociatedTangent, Prediction, SparseTangent, Tangent

OWNER = "Newton"
# Distance by which a difference moves a point, in spacings, by precision: truncation and round-off are alike.
DISTANCE = {64: 1e-5, 32: 3e-3}


class NeuralTangent(Tangent):
    """Products by differences of the force; what they are preconditioned with by the bond-associated law.

    That law has the same material, horizon and influence function, and the same stress in uniform states. Its tangent
    is symmetric and factorised once a step; iterations (GMRES) with products of the neural law make up for the rest.
    """

    symmetric = False
    direct_points = 100_000

    def __init__(self, force: FamilyLaw, like: BondAssociated, context: Context) -> None:
        """Build `like`, the other law. Raises InputError if bonds can break, or for a material without `response`."""
        if force.intact is not None:
            raise InputError("damage: expected None with the law Neural and the solver Newton, or the solver Explicit")
        self.force, self.context = force, context
        near, bare = (context.on(context.sheet, name, context.held) for name in ("near ", "bare "))
        near.state = bare.state = context.state
        other = BondAssociatedForce(like, near)
        # With the tension that Newton's method adds, and without.
        self.near, self.bare = BondAssociatedTangent(other, near), BondAssociatedTangent(other, bare)
        self.inverse_blocks = self.near.inverse_blocks
        t, n = context.types, force.points
        self._no_tension = context.array("no_tension", OWNER, t.real, shape=1, per="once")
        self._image = context.array("bare_image", OWNER, t.vec3, shape=n)
        self._ahead, self._behind, self._force_ahead, self._force_behind = (
            context.array(name, OWNER, t.vec3, shape=n, halo=True)
            for name in ("ahead", "behind", "force_ahead", "force_behind")
        )
        self._step = context.array("difference_step", OWNER, t.real, shape=1, per="once")
        self._displacement: Array | None = None

    def add_linearise(
        self, stage: Stage, displacement: Array, tension: Array, inertia: Array | None = None,
        predicted: Prediction | None = None,
    ) -> None:  # fmt: skip
        """Add the launches that compute the tangent of the bond-associated law at a displacement; see `Tangent`."""
        if inertia is not None:
            raise InputError("force = Neural: not supported by the solver Implicit; expected Explicit")
        self._displacement = displacement
        self.bare.add_linearise(stage, displacement, self._no_tension)
        self.near.add_linearise(stage, displacement, tension)

    def add_product(self, stage: Stage, direction: Array, change: Array, rough: bool = False) -> None:
        """Add the launches that fill `change` [N] with the derivative of the force along a direction [m]."""
        find_step, displace, difference = differences(self.context.bits)
        n, distance = self.force.points, DISTANCE[self.context.bits] * self.context.sheet.spacing
        self.bare.add_product(stage, direction, self._image)
        self.near.add_product(stage, direction, change)
        stage.launch(OWNER, find_step, 1, direction=direction, distance=distance, step=self._step)
        stage.launch(
            OWNER, displace, n, displacement=self._displacement, direction=direction, step=self._step,
            ahead=self._ahead, behind=self._behind,
        )  # fmt: skip
        self.force.add_force(stage, self._ahead, self._force_ahead)
        self.force.add_force(stage, self._behind, self._force_behind)
        stage.launch(
            OWNER, difference, n, force_ahead=self._force_ahead, force_behind=self._force_behind, step=self._step,
            bare=self._image, change=change,
        )  # fmt: skip

    def add_turning(self, stage: Stage, direction: Array) -> Array | None:
        """Add the launch of the bond-associated law."""
        return self.near.add_turning(stage, direction)

    def is_slack(self) -> bool:
        """Whether the sheet carries no stress."""
        return self.near.is_slack()

    def modulus(self) -> float:
        """Size of the moduli [Pa], that of the bond-associated tangent beside it."""
        return self.near.modulus()

    def mean_tension(self) -> float:
        """Mean tension of the sheet [Pa]."""
        return self.near.mean_tension()

    def min_tension(self, relative: float) -> float:
        """Zero, because the tangent needs no added tension."""
        return 0.0

    def sparse(self) -> SparseTangent:
        """The tangent of the bond-associated law as a sparse matrix."""
        return self.near.sparse()
