"""The sum of all loads on a device."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..context import Context
from ..device.fields import Array
from ..device.launches import Stage
from ..kernels.loads import begin_loads
from ..step import Phase
from .built_part import BuiltPart
from .part import BuiltLoad


class ExternalForce(BuiltPart):
    """The sum of all loads: constant loads are summed once, the others by launches.

    Attributes:
        constant: Sum of the constant loads [N], shape (N, 3); None if there are none.
        changing: The other loads.
        following: Those of `changing` that depend on the displacement.
        contacts: Contact in static equilibrium, of those of `following` that are contact.
    """

    def __init__(self, context: Context, loads: Sequence[BuiltLoad]) -> None:
        self.context = context
        self.constant: np.ndarray | None = None
        self.changing: list[BuiltLoad] = []
        for load in loads:
            force = load.constant_force()
            if force is None:
                self.changing.append(load)
            else:
                # Start from zero, so that no sum is a negative zero.
                self.constant = (0.0 if self.constant is None else self.constant) + force
        self.following = [load for load in self.changing if load.follows_displacement]
        self.contacts = [load.at_rest for load in self.following if load.at_rest is not None]
        self._constant: Array | None = None
        # All processes must have the same fields.
        if self.changing and self.constant is not None and (self.constant.any() or context.partition is not None):
            self._constant = context.array("constant_loads", "loads", context.types.vec3, self.constant)
        self._dead: Array | None = None

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches that recompute the external force; none if it is constant."""
        if phase is Phase.EXTERNAL_FORCE and self.context.state.external is not None:
            self.add_force(stage, self.context.state.displacement, self.context.state.external)

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the external force [N]; none if it is constant."""
        if not self.changing:
            return
        if self._dead is None:
            self._add_begin(stage, self._constant, out)
            for load in self.changing:
                load.add_force(stage, displacement, out)
        else:
            self.add_dead(stage, self._dead)
            self._add_begin(stage, self._dead, out)
            self.add_following(stage, displacement, out)

    def keep_dead_apart(self) -> Array | None:
        """Let `add_force` also store the sum of the displacement-independent loads [N], (N,) vec3, and return it.

        None unless there are loads of both kinds.
        """
        if not self.following:
            return None
        if self._dead is None and len(self.following) < len(self.changing):
            context = self.context
            self._dead = context.array("dead_loads", "loads", context.types.vec3, shape=context.sheet.size)
        return self._constant if self._dead is None else self._dead

    def _add_begin(self, stage: Stage, constant: Array | None, out: Array) -> None:
        begin = begin_loads(self.context.bits, constant is not None)
        stage.pointwise("loads", begin, self.context.sheet.size, constant=constant, external=out)

    def add_dead(self, stage: Stage, out: Array) -> None:
        """Add the launches that fill `out` with the force of the displacement-independent loads [N]."""
        self._add_begin(stage, self._constant, out)
        for load in self.changing:
            if load not in self.following:
                load.add_force(stage, self.context.state.displacement, out)

    def add_following(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that add the force of the displacement-dependent loads to `out` [N]."""
        for load in self.following:
            load.add_force(stage, displacement, out)
