"""Contact with a rigid body in equilibrium: multipliers, their stiffness, and what a load step may not pass."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..device.fields import Array
from ..device.launches import Stage, with_values
from ..interfaces import BuiltLaw, BuiltLoad, History
from ..kernels.contact.static_contact import static_contact
from ..kernels.effects import Kernel
from ..step import Phase
from .bodies import BodySettings, BuiltBody, partly_held
from .body_checks import bond_bits, ignoring, passes, sweeps, torn_since
from .body_motion import UNBOUNDED, jump_notes

# Depth inside a body, over its thickness, at which a point between two equilibria counts as passing through; a point
# that slides along a sphere may go 80 degrees around.
PASSING = 0.125
# Factor by which the stiffness grows from a round to the next, if more than this part of the largest distance of a
# point from the surface is left.
STIFFER, LEFT = 4.0, 0.25
# That distance in equilibrium [spacings], and the largest change of a pressure in the last round over the largest
# pressure, in float64 and float32.
SETTLED, STEADY = {64: 1e-5, 32: 1e-4}, {64: 1e-5, 32: 1e-4}
# Part of the distance before the last round above which further rounds do not lessen it: it is within the tolerance of
# the solver, or its round-off.
STUCK = 0.9
# Relative change of the stiffness of a point that touches from which a tangent is another.
ANEW = 0.5


class BodyAtRest(BuiltBody, BuiltLoad):
    """Frictionless contact with a body in equilibrium; see kernels/contact/static_contact.py.

    Attributes:
        multiplier: Lagrange multiplier: pressure at the last equilibrium [Pa], (N,) float64.
        blocks: Derivative of the force on each point by its displacement [N/m], (N,) mat33.
    """

    follows_displacement = True
    symmetric = True

    def __init__(self, part: BodySettings, context: Context, law: BuiltLaw) -> None:
        if part.motion.free:
            raise InputError(
                f"{part.title}: motion = Free: expected a BodyPath with a static solver or implicit steps; Free needs "
                "Explicit"
            )
        for name, value, wanted in (("friction", part.friction, 0), ("surface", part.surface, False)):
            if value != wanted:
                raise InputError(
                    f"{part.title}: {name} = {value!r}: expected {wanted!r} with a static solver or implicit steps; "
                    f"{name} needs Explicit"
                )
        super().__init__(part, context, law)
        name, points, types = part.name, context.sheet.size, context.types
        self.at_rest = self
        self.multiplier = context.array(f"{name}_multiplier", name, wp.float64, shape=points, restart=True)
        # The stiffness [Pa/m], and the largest distance from the surface in the round before [m], so that a step that
        # is refused restores both.
        self._stiffness = context.array(f"{name}_stiffness", name, wp.float64, shape=2, per="once", restart=True)
        self._softest, self._refused = 0.0, 0
        self._law, self._at_start = law, bond_bits(law)
        self._before = np.empty((0, 3))
        self.blocks = context.array(f"{name}_stiffness_of_points", name, types.mat33, shape=points)
        self._areas = context.array(f"{name}_areas", name, types.real, context.sheet.areas)
        self._off = context.array(f"{name}_off", name, wp.float64, shape=points)
        self._kernels = static_contact(
            context.bits, part.shape.distance, self._curved, context.options.held, partly_held(context.held)
        )

    def _contact(self) -> Any:
        part, context = self.part, self.context
        radius = part.shape.radius()
        values = {
            "reference": self._reference, "origin": self._origin, "areas": self._areas,
            "held_mask": context.state.held_mask, "multiplier": self.multiplier, "body": self._body,
            "place": self.motion.place, "rotation": self.motion.rotation, "stiffness": self._stiffness,
            "reach": radius if np.isfinite(radius) else UNBOUNDED, "around": 0.25 * context.sheet.spacing,
        }  # fmt: skip
        return with_values(self._kernels.struct(), values)

    def _launch(self, stage: Stage, kernel: Kernel, displacement: Array, **arrays: Any) -> None:
        points = self.context.sheet.size
        stage.launch(self.part.name, kernel, points, displacement=displacement, a=self._contact(), **arrays)

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of the motion and, for frames, those of forces and torques."""
        self.motion.add(phase, stage)
        if phase is Phase.FRAME:
            displacement = self.context.state.displacement
            self._launch(stage, self._kernels.show, displacement, force=self.impulse, turn=self.turn)

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launch that adds the contact forces to `out`."""
        self._launch(stage, self._kernels.press, displacement, out=out)

    def add_blocks(self, stage: Stage, displacement: Array) -> None:
        """Add the launch that fills `blocks`."""
        self._launch(stage, self._kernels.linearise, displacement, blocks=self.blocks)

    def prepare(self) -> None:
        """Add the stages that update the multipliers, and that ask whether other points touch."""
        displacement = self.context.state.displacement
        stage = self.context.stage(f"multipliers of {self.part.name}", "every equilibrium")
        self._launch(stage, self._kernels.settle, displacement, multiplier=self.multiplier, change=self._off)
        stage = self.context.stage(f"blocks of {self.part.name}", "every step that may take the tangent of another")
        self._launch(stage, self._kernels.differ, displacement, blocks=self.blocks, off=self._off)

    def touches_anew(self) -> bool:
        """Return whether other points touch than in `blocks`, or with another stiffness."""
        self.context.sequence(f"blocks of {self.part.name}").run()
        return bool(self._off.numpy().max() > ANEW)

    def set_stiffness(self, stiffness: float) -> None:
        """Set the contact stiffness [Pa/m], unless already set."""
        if not self._stiffness.numpy()[0]:
            self._stiffness.assign(np.array([stiffness, np.inf]))
        self._softest = float(self._stiffness.numpy()[0])
        self._before = self._from_centre()

    def _from_centre(self) -> np.ndarray:
        """Positions of the points relative to the centre of the body [m], shape (N, 3)."""
        context = self.context
        here = context.sheet.positions + np.asarray(context.state.displacement.numpy(), np.float64)
        return np.asarray(here - self.motion.place.numpy()[0])

    def passed(self) -> bool:
        """Return whether the body has passed through the sheet since the last load step that it did not."""
        if not self.part.shape.bounded:
            # The centre of a half space lies on its surface.
            return False
        torn, now = torn_since(self._at_start, self._law), self._from_centre()
        found = passes(self._before, now, self.context.sheet.triangles, torn) or self._sweeps(now, torn)
        if found:
            self._refused += 1
        else:
            self._before = now
        return found

    def _sweeps(self, now: np.ndarray, torn: np.ndarray | None) -> bool:
        """Whether free points with all their bonds moved through the body to positions `now`."""
        shape, rotation, centre = self.part.shape, self.motion.rotation.numpy()[0], np.zeros(3)
        depth = min(self.context.sheet.spacing, PASSING * shape.thinnest())
        free = ~ignoring(self.context.held)
        chosen = free if torn is None else free & ~torn
        return sweeps(
            self._before[chosen], now[chosen], shape, depth, lambda places: self._distances(places, centre, rotation)
        )

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on a body that never touched the sheet, and on load steps in which it would have passed through it."""
        untouched = self._untouched(history)
        if not self._refused:
            return [untouched] if untouched else jump_notes(self.label, self.part.motion, history)
        rigid = ", or no rigid inclusions, whose points ignore it" if self.context.sheet.inclusions else ""
        return [
            f"{self.label}: load steps refused because it passed through the sheet: {self._refused}; expected more "
            f"load_steps, a thicker body, or more points{rigid}"
        ]

    def update_multipliers(self) -> bool:
        """Take the pressures as multipliers; return whether another round is needed.

        It is while a point is off the surface, or while its pressure changes: a stiff sheet pushes hard at small
        distances. With a stiffness that stays, so does a factorised tangent.
        """
        context = self.context
        context.run(f"multipliers of {self.part.name}")
        stiffness, earlier = self._stiffness.numpy()
        pressures, changes = self.multiplier.numpy(), self._off.numpy()
        change = float(np.abs(changes).max())
        distance = change / stiffness
        off = bool(distance > SETTLED[context.bits] * context.sheet.spacing)
        if not off and distance > STUCK * earlier:
            # The sheet is in equilibrium with the multipliers before.
            self.multiplier.assign(pressures - changes)
        elif not off:
            off = change > STEADY[context.bits] * float(pressures.max())
        if not off:
            stiffness, distance = self._softest, np.inf
        elif distance > LEFT * earlier:
            stiffness *= STIFFER
        self._stiffness.assign(np.array([stiffness, distance]))
        return off

    def _mean_forces(
        self, before: Mapping[str, float], totals: Mapping[str, float], elapsed: float
    ) -> dict[str, float]:
        """Forces [N] and torques about the centre [N m] on the body, which `impulse` and `turn` hold."""
        return super()._mean_forces({}, totals, 1.0)
