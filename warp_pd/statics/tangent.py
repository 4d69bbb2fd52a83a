"""Tangents of force laws, for Newton's method."""

from __future__ import annotations

import functools
import weakref
from typing import TYPE_CHECKING, Any, NamedTuple, Protocol

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array, doubles
from ..device.launches import Stage
from ..families import Families
from ..interfaces import BuiltLaw
from ..kernels.statics.blocks import ROW
from ..kernels.statics.bond_associated_tangent import assembly, linearisation, matrix_free, turning
from ..kernels.statics.tangent_matrix import tangent_matrix
from ..laws.bond_associated import BondAssociatedForce
from ..laws.force_paths import ROWS_MEMBERS, BondAssociatedLaw
from ..materials import capabilities, modulus_in_tension
from .factors import Factoriser, Solve

if TYPE_CHECKING:
    from scipy.sparse import bsr_matrix, csc_matrix


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

    def add_product(self, stage: Stage, direction: Array, change: Array, rough: bool = False) -> None:
        """Add the launches that fill `change` [N] with the derivative of the force along a direction [m].

        `rough`: whether single precision of the stiffness will do, as in the sweeps of multigrid.
        """
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
    raise _refusal(law, context)


@tangent_of.register
def _(law: BondAssociatedForce, context: Context, geometric: bool) -> Tangent:
    """Refuses weights without an energy, a material without `response`, or `geometric` = False."""
    if not (law.law.has_tangent or law.steps_implicitly):
        raise _refusal(law, context)
    if law.weights == "published":
        raise InputError(
            "weights = 'published': expected 'plain' or 'corrected', which have an energy and so a tangent; or use the "
            "solver Explicit or Relaxation"
        )
    if not geometric:
        raise InputError("stiffness = 'constant': expected 'tangent'; only the law BondBased has 'constant'")
    return BondAssociatedTangent(law, context)


def _refusal(law: BuiltLaw, context: Context) -> InputError:
    name = getattr(law, "owner", type(law).__name__)
    if context.dynamic and context.at_rest:
        return InputError(
            f"force = {name}: not supported by the solver Implicit; expected BondAssociated or Visco, or the solver "
            "Explicit"
        )
    others = "Explicit" if getattr(law, "depends_on_time", False) else "Explicit or Relaxation"
    return InputError(
        f"force = {name}: expected BondAssociated, BondBased or Neural, which have a tangent; or use the solver "
        f"{others}"
    )


OWNER = "Newton"
# Largest stress divided by the modulus of a sheet that counts as slack.
SLACK_STRESS = 1e-6
# Stiffness over modulus times thickness that a factorisation adds to every component where bonds can break: points
# without bonds stay where they are. The force has no part in it.
LOOSE = 1e-9


class BondAssociatedTangent:
    """The tangent of the bond-associated law, matrix-free or stored.

    Attributes:
        gradient: F of every intersection [-], (members, N).
        stress: Weighted stress of every intersection [Pa], (members, N).
        moduli: Weighted moduli of every intersection [Pa], (members, N).
        inverse_blocks: Inverse diagonal blocks of the stiffness, (N,) mat33 [m/N].
    """

    direct_points = 0
    symmetric = True
    can_predict, predicts = True, False

    def __init__(self, force: BondAssociatedLaw, context: Context) -> None:
        """Allocate the tangent. Raises InputError for a material without `response`."""
        self.force, self.context, self.held = force, context, context.held
        t, shape, n = context.types, (force.families.members, force.points), force.points
        self.gradient = context.array("gradient", OWNER, t.mat32, shape=shape, per="bond")
        self.stress = context.array("stress", OWNER, t.vec3, shape=shape, per="bond")
        self.moduli = context.array("moduli", OWNER, t.vec6, shape=shape, per="bond")
        self.inverse_blocks = context.array("inverse_blocks", OWNER, t.mat33, shape=n)
        self.inertia: Array | None = None
        material, remembered = force.material, force.response_in_step
        response = capabilities(material).response if remembered is None else remembered.response
        if response is None:
            raise InputError(
                f"material = {type(material).__name__}: expected a material with `response`, from which this solver "
                "takes its tangent; or the solver Explicit or Relaxation"
            )
        tables = stored_on(context.device) and force.families.members <= ROWS_MEMBERS
        self._linearise, self._predict = linearisation(
            force.layout, response, remembered is not None, force.families.words * tables
        )
        self._remembered: dict[str, Any] = {"terms": None, "state": None}
        if remembered is not None:
            self._remembered = {"terms": remembered.terms, "state": remembered.state}
        self.matrix: TangentMatrix | None = None
        self._assembly: tuple[Stage, Array] | None = None

    def add_linearise(
        self, stage: Stage, displacement: Array, tension: Array, inertia: Array | None = None,
        predicted: Prediction | None = None,
    ) -> None:  # fmt: skip
        """Add the launches that compute the tangent at a displacement; see `Tangent`."""
        force, n, self.inertia = self.force, self.force.points, inertia
        state: dict[str, Any] = {"gradient": self.gradient, "stress": self.stress, "moduli": self.moduli}
        held_mask = self.context.state.held_mask
        stage.launch(
            OWNER, self._linearise, n,
            family=force.struct, displacement=displacement, constants=force.constants, tension=tension,
            damage=force.damage, **self._remembered, **state,
        )  # fmt: skip
        if predicted is not None:
            stage.launch(
                OWNER, self._predict, n,
                family=force.struct, **predicted._asdict(), constants=force.constants, tension=tension,
                damage=force.damage, **self._remembered, stress=self.stress,
            )  # fmt: skip
        self._assembly = (stage, displacement)
        if stored_on(self.context.device):
            self.matrix = TangentMatrix(self, stage, displacement)
            self.matrix.add_inverse_diagonal(stage, self.inverse_blocks)
            return
        stage.launch(
            OWNER, matrix_free(force.layout, self.context.options.held)[1], n,
            family=force.struct, displacement=displacement, **state, held_mask=held_mask, inertia=inertia,
            unit_stiffness=force.unit_stiffness, out=self.inverse_blocks,
        )  # fmt: skip

    def add_product(self, stage: Stage, direction: Array, change: Array, rough: bool = False) -> None:
        """Add the launches that fill `change` [N] with the derivative of the force along a direction [m]."""
        force, n = self.force, self.force.points
        if stored_on(self.context.device):
            assert self.matrix is not None
            self.matrix.add_product(stage, direction, change, rough)
            return
        stage.launch(
            OWNER, matrix_free(force.layout, self.context.options.held)[0], n,
            family=force.struct, direction=direction, gradient=self.gradient, stress=self.stress,
            moduli=self.moduli, unit_force=force.unit_force,
            bond_force=force.pairs,
        )  # fmt: skip
        force.add_gather(stage, force.pairs, change, softens=False)
        if self.inertia is not None:
            kernel = tangent_matrix(self.context.bits, self.context.options.held).resist
            stage.launch(OWNER, kernel, n, inertia=self.inertia, direction=direction, change=change)

    def add_turning(self, stage: Stage, direction: Array) -> Array | None:
        """Add the launch that finds the step along a direction [m] that turns the family of a point inside out, (N,).

        A material that goes slack may fold, and nothing is added.
        """
        force = self.force
        if force.goes_slack:
            return None
        longest = self.context.array("longest_step", OWNER, self.context.types.real, shape=force.points)
        stage.launch(
            OWNER, turning(force.layout), force.points,
            family=force.struct, direction=direction, gradient=self.gradient,
            longest=longest,
        )  # fmt: skip
        return longest

    def is_slack(self) -> bool:
        """Whether the sheet carries no stress: a flat sheet then has no out-of-plane stiffness."""
        return bool(np.abs(self.stress.numpy()).max() < SLACK_STRESS * self.modulus())

    def modulus(self) -> float:
        """Mean of dS11/dC11 over the sheet [Pa], at the last linearisation; of a slack sheet what it has when taut."""
        return float(self.moduli.numpy()[..., 0].sum() / self.force.points) or self._taut_modulus

    @functools.cached_property
    def _taut_modulus(self) -> float:
        return modulus_in_tension(self.force.material, self.context.device)

    def mean_tension(self) -> float:
        """Mean of (S11 + S22) / 2 over the sheet [Pa], at the last linearisation."""
        return float(0.5 * self.stress.numpy()[..., :2].sum() / self.force.points)

    def min_tension(self, relative: float) -> float:
        """Zero, because the tangent needs no added tension."""
        return 0.0

    def sparse(self) -> TangentMatrix:
        """The tangent as a sparse matrix, from the next linearisation on."""
        if self.matrix is None:
            assert self._assembly is not None
            self.matrix = TangentMatrix(self, *self._assembly)
        return self.matrix


def stored_on(device: Any) -> bool:
    """Whether tangents are stored on a device, which makes products four times faster on a CPU."""
    return bool(device.is_cpu)


class HostBlocks:
    """Rows of 3x3 blocks on the device as a sparse matrix of the free components on the host.

    Args:
        starts: First block of each row, (N + 1,).
        columns: Columns of the blocks, (blocks,).
        blocks: The blocks [N/m], (blocks,) mat33.
        free: Mask of free components, (3 N,).
    """

    def __init__(self, starts: Array, columns: Array, blocks: Array, free: np.ndarray) -> None:
        self._starts, self._columns, self._blocks, self._free = starts, columns, blocks, free

    @functools.cached_property
    def _entries(self) -> csc_matrix:
        """Matrix of the free components whose values are the places of its entries in `blocks`, counted from 1."""
        from scipy import sparse

        n, starts, columns = self._free.size, self._starts.numpy(), self._columns.numpy()
        places = np.arange(1, 9 * len(columns) + 1).reshape(-1, 3, 3)
        whole = sparse.bsr_matrix((places, columns, starts), shape=(n, n)).tocsc()
        return whole[:, self._free].tocsr()[self._free].tocsc()

    def matrix(self) -> csc_matrix:
        """The matrix, without entries that are zero."""
        found = self._entries.astype(np.float64)
        found.data = self._blocks.numpy().ravel()[self._entries.data - 1].astype(np.float64)
        found.eliminate_zeros()
        return found


class TangentMatrix:
    """The tangent as a sparse matrix of 3x3 blocks, assembled on the device.

    Follower pressure is not included, so the matrix is symmetric.

    Attributes:
        free: Mask of free components, shape (3 N,).
        blocks: The blocks, row by row [N/m], (entries,) mat33.
        starts: First entry of each row, (N + 1,).
        columns: Columns of the entries, ascending in each row, (entries,).
    """

    def __init__(self, tangent: BondAssociatedTangent, stage: Stage, displacement: Array) -> None:
        """Allocate the matrix, and add the launch that fills it after those of the linearisation."""
        force, context, self._stage = tangent.force, tangent.context, stage
        # Which has the matrix.
        self.tangent: BondAssociatedTangent = weakref.proxy(tangent)
        self.free = ((tangent.held[:, None] >> np.arange(3)) & 1 == 0).ravel()
        self._kernels = tangent_matrix(context.bits, context.options.held)
        self._held_mask = context.state.held_mask
        starts, columns = pattern(force.families)
        self.starts = context.array("matrix_starts", OWNER, wp.int32, starts, per="table")
        self.columns = context.array("matrix_columns", OWNER, wp.int32, columns, per="table")
        self.blocks = context.array("matrix", OWNER, context.types.mat33, shape=len(columns), per="once")
        self._host = HostBlocks(self.starts, self.columns, self.blocks, self.free)
        self._factorise = Factoriser(self.free)
        members, t = force.families.members, context.types
        row = wp.types.vector(length=ROW, dtype=t.real)
        shape = (force.points, members)
        moments = context.array("stiffness_moments", OWNER, t.vec2, shape=shape, intermediate=True)
        stiffness = context.array("stiffness", OWNER, row, shape=shape, intermediate=True)
        of_centre = context.array(
            "stiffness_of_centre", OWNER, t.mat33, shape=(force.points, members + 1), intermediate=True
        )
        stiffen, assemble = assembly(force.layout)
        stage.launch(
            OWNER, stiffen, force.points,
            family=force.struct, displacement=displacement, gradient=tangent.gradient, stress=tangent.stress,
            moduli=tangent.moduli, unit_stiffness=force.unit_stiffness, moments=moments, stiffness=stiffness,
            of_centre=of_centre,
        )  # fmt: skip
        stage.launch(
            OWNER, assemble, force.points,
            family=force.struct, moments=moments, stiffness=stiffness, of_centre=of_centre, starts=self.starts,
            columns=self.columns, matrix=self.blocks,
        )  # fmt: skip
        stage.launch(
            OWNER, self._kernels.mirror, force.points, starts=self.starts, columns=self.columns, matrix=self.blocks
        )
        if tangent.inertia is not None:
            stage.launch(
                OWNER, self._kernels.add_inertia, force.points,
                inertia=tangent.inertia, starts=self.starts, columns=self.columns, matrix=self.blocks,
            )  # fmt: skip

    def add_product(self, stage: Stage, direction: Array, change: Array, rough: bool) -> None:
        """Add the launch that fills `change` [N] with the derivative of the force along a direction [m]."""
        rough = rough and self.blocks.dtype is not wp.mat33f
        stage.launch(
            OWNER, self._kernels.rough_product if rough else self._kernels.product, self.tangent.force.points,
            matrix=self._rough_blocks if rough else self.blocks, starts=self.starts, columns=self.columns,
            direction=direction, change=change,
        )  # fmt: skip

    @functools.cached_property
    def _rough_blocks(self) -> Array:
        """The blocks in single precision, which the stage of the linearisation then fills: half as much to read."""
        tangent = self.tangent
        rough = tangent.context.array("rough_matrix", OWNER, wp.mat33f, shape=self.blocks.size, per="once")
        self._stage.launch(
            OWNER, self._kernels.round_blocks, tangent.force.points,
            matrix=self.blocks, starts=self.starts, rough=rough,
        )  # fmt: skip
        return rough

    def add_inverse_diagonal(self, stage: Stage, inverse_blocks: Array) -> None:
        """Add the launch that inverts the diagonal blocks."""
        stage.launch(
            OWNER, self._kernels.inverse_diagonal, self.tangent.force.points,
            matrix=self.blocks, starts=self.starts, columns=self.columns, held_mask=self._held_mask,
            out=inverse_blocks,
        )  # fmt: skip

    def whole(self) -> bsr_matrix:
        """K of all components [N/m], shape (3 N, 3 N); a held one is coupled to no other, with its own stiffness."""
        from scipy import sparse

        starts, columns = self.starts.numpy(), self.columns.numpy()
        blocks, free = doubles(self.blocks), self.free.reshape(-1, 3)
        rows = np.repeat(np.arange(len(free)), np.diff(starts))
        own = np.flatnonzero(rows == columns)
        bound = ~free.all(axis=1)
        coupled = np.flatnonzero(bound[rows] | bound[columns])
        stiffness = np.abs(blocks[own][:, np.arange(3), np.arange(3)])
        blocks[coupled] *= free[rows[coupled], :, None] & free[columns[coupled], None, :]
        blocks[own[:, None], np.arange(3), np.arange(3)] += np.where(free, 0.0, stiffness)
        return sparse.bsr_matrix((blocks, columns, starts), shape=(free.size, free.size))

    def matrix(self) -> csc_matrix:
        """K of the free components [N/m], shape (free, free)."""
        return self._host.matrix()

    def factorise(self, added: np.ndarray | None = None) -> Solve | None:
        """Solver of K x = b on arrays of shape (N, 3), with blocks added to K; None if K is singular."""
        from scipy import sparse

        matrix, t = self.matrix(), self.tangent
        if t.force.intact is not None:
            least = LOOSE * t.modulus() * t.force.thickness
            matrix += least * sparse.identity(matrix.shape[0], format="csc")
        return self._factorise(matrix, added)


# Patterns of families that are kept, see TABLES of laws/weight_tables.py.
_PATTERNS: weakref.WeakKeyDictionary[Families, tuple[np.ndarray, np.ndarray]] = weakref.WeakKeyDictionary()


def pattern(families: Families) -> tuple[np.ndarray, np.ndarray]:
    """Points that share a family, as starts of rows, shape (N + 1,), and columns in ascending order."""
    if families not in _PATTERNS:
        _PATTERNS[families] = _pattern(families)
    return _PATTERNS[families]


def _pattern(families: Families) -> tuple[np.ndarray, np.ndarray]:
    from scipy import sparse

    n, every = families.points, np.arange(families.points)
    point, member = np.nonzero(families.rows_of_points(families.exists))
    ends = np.concatenate([point, every]), np.concatenate([families.heads(point, member), every])
    together = sparse.csr_matrix((np.ones(len(ends[0]), np.int32), ends), shape=(n, n))
    found = (together.T @ together).tocsr()
    found.sort_indices()
    return found.indptr, found.indices
