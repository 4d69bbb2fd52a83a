"""One level (lattice) of the search for static equilibrium: unbalanced force, trial steps, stiffness products."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array, assign, copy, dot, doubles, on_cpu, total
from ..device.launches import Stage
from ..interfaces import BuiltLaw, BuiltLoad
from ..interfaces.part import StaticContact
from ..kernels.statics.equilibrium import equilibrium
from .static_rounds import LoadScale
from .tangent import Prediction, Tangent

OWNER = "Newton"
# By precision: unbalanced force over what moves a stressed sheet, in equilibrium; and over loads and reactions, below
# which round-off hides it.
ACCURACY, ROUND_OFF = {64: 1e-5, 32: 1e-3}, {64: 1e-12, 32: 1e-5}


# A step of so many spacings turns no family inside out that is not compressed to a hundredth.
TINY = 5e-4


class Level:
    """The sheet, or a coarser lattice over it, with the stages "evaluate", "advance", "linearise", "product".

    Attributes:
        context: Arrays and stages of this sheet.
        tangent: Tangent of its internal force.
        following: Loads that depend on the displacement, without contact.
        contacts: Bodies that touch the sheet.
        displacement: Displacement at which the residual is evaluated [m], (N,) vec3.
        base: Last accepted displacement [m].
        direction: Newton's step [m].
        residual: Unbalanced force on free components [N].
        scale: Loads and reactions.
        inertia: Stiffness of inertia and damping in a time step [N/m], (N,); None in equilibrium.
        vector: Input of the product.
        image: Output of the product.
        predicts: Whether Newton's steps take tangents with predicted stresses.
        predicting: Whether the next tangent does.
        exact: Whether the last tangent was that of the sheet: without added tension, and with the stresses there.
    """

    predicting = False
    exact = False

    def __init__(
        self, context: Context, law: BuiltLaw, tangent: Tangent, following: Sequence[BuiltLoad],
        contacts: Sequence[StaticContact] = (), tolerance: float | None = None, moves: bool = False,
    ) -> None:  # fmt: skip
        """Allocate the vectors and add all stages but "evaluate".

        A coarse lattice has no `tolerance`. In time steps (`moves`) the tangent includes inertia.
        """
        self.context, self.law, self.tangent = context, law, tangent
        self.following = [load for load in following if load.at_rest is None]
        self.contacts = contacts
        t, n = context.types, context.sheet.size
        self.displacement = context.state.displacement
        self.kernels = equilibrium(t.bits, context.options.held)
        self.base = context.array("base", OWNER, t.vec3, shape=n)
        self.direction = context.array("newton_step", OWNER, t.vec3, shape=n)
        self.residual = context.array("unbalanced", OWNER, t.vec3, shape=n)
        self._squared = context.array("squared_unbalanced", OWNER, wp.float64, shape=n)
        fine, accuracy = tolerance is not None, ACCURACY[t.bits]
        self.scale = LoadScale(context, OWNER, tolerance or accuracy, accuracy, ROUND_OFF[t.bits], stressed=fine)
        self.vector = context.array("vector", OWNER, t.vec3, shape=n, halo=True)
        self.image = context.array("image", OWNER, t.vec3, shape=n)
        self._tension = context.array("tension", OWNER, t.real, shape=1, per="once")
        self._step_length = context.array("step_length", OWNER, t.real, shape=1, per="once")
        context.stage("advance", "every trial step of Newton").launch(
            OWNER, self.kernels.advance, n,
            base=self.base, direction=self.direction, step_length=self._step_length, displacement=self.displacement,
        )  # fmt: skip
        linearise = context.stage("linearise", "every tangent of Newton")
        self.inertia = context.array("inertia", OWNER, t.real, shape=n) if moves else None
        self.predicts = tangent.predicts
        self._prediction: Prediction | None = None
        if self.predicts:
            base = context.array("base_before", OWNER, t.vec3, shape=n)
            tensile = context.array("tensile", OWNER, t.real, shape=1, per="once")
            self._prediction = Prediction(base, self.direction, tensile)
        tangent.add_linearise(linearise, self.displacement, self._tension, self.inertia, self._prediction)
        stages = [linearise]
        if self.contacts:
            stages.append(context.stage("contact stiffness", "every step with the tangent of other points that touch"))
        for stage, contact in itertools.product(stages, self.contacts):
            contact.add_blocks(stage, self.displacement)
        self._longest: Array | None = None
        self.add_product(context.stage("product", "every iteration of the linear solve"), self.vector, self.image)

    @property
    def points(self) -> int:
        """Number of points."""
        return self.context.sheet.size

    @property
    def held(self) -> np.ndarray:
        """Mask of held components, shape (N, 3)."""
        return np.asarray((self.context.held[:, None] >> np.arange(3)) & 1 == 1)

    def add_turning(self) -> None:
        """Add the stage that finds the longest step, which only the finest level takes."""
        stage = self.context.stage("turning", "every step of Newton")
        self._longest = self.tangent.add_turning(stage, self.direction)

    def add_residual(self, stage: Stage, dead: Array | None) -> None:
        """Add the residual to the stage "evaluate", after the launches of internal and external force.

        `dead` are the dead loads [N] if there are also displacement-dependent loads, otherwise None.
        """
        self.scale.add(stage, dead, self.residual, self._squared)

    def sums_of_forces(self) -> dict[str, Any]:
        """The unbalanced force, its square and what it is compared with, by the arguments of `residual`."""
        return {"unbalanced": self.residual, "squared": self._squared, **self.scale.sums}

    def add_product(
        self, stage: Stage, vector: Array, image: Array, following: bool = True, rough: bool = False
    ) -> None:
        """Add the launches of image = K vector, both (N,) vec3, with zero in held components.

        `following`: whether K includes displacement-dependent loads; `rough`: whether single precision of K will do.
        """
        self.tangent.add_product(stage, vector, image, rough)
        for contact in self.contacts:
            kernel = self.kernels.add_blocks
            stage.launch(OWNER, kernel, self.points, blocks=contact.blocks, direction=vector, change=image)
        if following:
            for load in self.following:
                if not load.add_tangent(stage, self.displacement, vector, image):
                    raise InputError(
                        f"{load.label}: expected a load with `add_tangent`, as it depends on the displacement, or the "
                        "solver Explicit or Relaxation"
                    )
        stage.launch(OWNER, self.kernels.hold, self.points, held_mask=self.context.state.held_mask, change=image)

    # What the host asks for ----------------------------------------------------------------------------

    def run(self, stage: str) -> None:
        """Run a stage now, or add its launches to the graph that is being captured."""
        context = self.context
        context.run(stage) if context.device.is_capturing else context.sequence(stage).run()

    def evaluate(self) -> tuple[float, float]:
        """Norms of the unbalanced force and of loads and reactions [N] at `displacement`."""
        self.run("evaluate")
        return float(np.sqrt(dot(self.residual, self.residual))), self.scale.size(total)

    def linearise(self, tension: float) -> None:
        """Compute the tangent at `displacement`, with an isotropic tension [Pa] added to the stress."""
        assign(self._tension, np.array([tension]))
        if self._prediction is not None and not self.predicting:
            copy(self._prediction.base, self.displacement)
            self.direction.zero_()
        self.run("linearise")
        self.exact = tension == 0.0 and not self.predicting

    def accept(self, shortened: bool) -> None:
        """Make the displacement of a trial step the base of the next one."""
        if self._prediction is not None:
            self.predicting = True
            copy(self._prediction.base, self.base)
            assign(self._prediction.tensile, np.array([float(shortened)]))
        copy(self.base, self.displacement)

    def contact_stiffness(self) -> np.ndarray | None:
        """Stiffness of contact, and of loads that tie points, at the last tangent [N/m], (N, 3, 3); None without."""
        blocks = [-doubles(contact.blocks) for contact in self.contacts]
        ties = [load.ties for load in self.following]
        blocks += [tie[:, None, None] * np.eye(3) for tie in ties if tie is not None]
        return np.sum(blocks, axis=0) if blocks else None

    def touches_anew(self) -> bool:
        """Whether other points touch a body than in the last tangent."""
        return any(contact.touches_anew() for contact in self.contacts)

    def longest_step(self) -> float:
        """Fraction of the direction at which the first family turns inside out; infinite if families may."""
        if self._longest is None:
            return math.inf
        if on_cpu(self.direction) and np.abs(self.direction.numpy()).max() < TINY * self.context.sheet.spacing:
            return math.inf
        self.run("turning")
        return float(self._longest.numpy().min())

    def step_to(self, step_length: float) -> None:
        """Set displacement = base + step length x direction."""
        assign(self._step_length, np.array([step_length]))
        self.run("advance")
