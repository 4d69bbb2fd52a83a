"""The force of a support, summed on the device, as columns of the history."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, point_indices
from ..device.launches import Stage
from ..interfaces import HELD, BuiltLaw, BuiltPart, Columns, Part
from ..kernels.integrate import RIGID
from ..kernels.loads import support_forces
from ..step import Phase

OWNER = "Reaction"


@dataclass(frozen=True, eq=False)
class Reaction(Part):
    """Output of the force of a support on its points: columns NAME_x, NAME_y and NAME_z of the history [N].

    It does not change the simulation. The force balances the internal force and the loads on the held components of
    its points, as in `warp_pd.measures.support_force`, without inertia; in components that nothing holds it is 0. The
    push of bodies along held components is in it with static solvers and `Implicit`. With `Explicit` it is not, with a
    note; nor are friction of `SelfContact` and its impulses with surface=True. The force is summed on the device, so
    the rows between frames (`Explicit(history_every=)`) have it as well.

    Attributes:
        points: Point indices, such as those of a `Fixed` or a `Motion`, which hold at least one of them.
        name: Prefix of the columns, a single word.
    """

    points: Any
    name: str = "reaction"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise InputError(f"Reaction.name = {self.name!r}: expected letters, digits and _, such as 'pull'")

    @property
    def only_one(self) -> str:
        """Its name."""
        return f"Reaction with the name {self.name!r}: expected different names"

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """The sum on a device. Raises InputError if a point does not exist, or nothing holds any of them."""
        points = np.asarray(point_indices("Reaction.points", self.points, context.sheet.size))
        require_held("Reaction.points", context.held[points])
        read_supports(f"Reaction {self.name!r}", points, context.held[points], context)
        return BuiltReaction(self.name, points, context)


def require_held(name: str, held: np.ndarray) -> None:
    """Check that a support holds a component of one of the points `name`; `held` are their bits, see State.held_mask.

    Raises:
        InputError: if not.
    """
    if not (held & HELD).any():
        inside = (held & RIGID).any()
        there = "they are in a rigid inclusion, whose force is in its own columns" if inside else "nothing holds them"
        raise InputError(f"{name}: expected points of a Fixed or a Motion, but {there}")


def read_supports(name: str, points: np.ndarray, held: np.ndarray, context: Context) -> None:
    """Tell contact that `name` gives the force of supports on points with these bits; see Context.support_readers."""
    partly = points[(held & HELD != 0) & (held & HELD != HELD) & (held & RIGID == 0)]
    context.support_readers[name] = np.union1d(context.support_readers.get(name, partly), partly)


class BuiltReaction(BuiltPart):
    """The sum on a device.

    Attributes:
        pull: Force of the support on each point [N], (P,) vec3.
    """

    label = "loads = Reaction"

    def __init__(self, name: str, points: np.ndarray, context: Context) -> None:
        self.name, self.context = name, context
        self.points = context.array("supported", OWNER, wp.int32, points.astype(np.int32), per="table")
        self.pull = context.array("pull", OWNER, context.types.vec3, shape=len(points), per="table")

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch of a frame."""
        if phase is Phase.FRAME:
            context, state = self.context, self.context.state
            stage.launch(
                OWNER, support_forces(context.bits, context.options.loaded), len(self.points), points=self.points,
                held_mask=state.held_mask, force=state.force, external=state.external, out=self.pull,
            )  # fmt: skip

    def columns(self) -> Columns:
        """Components of the force [N]."""
        names = [f"{self.name}_{c}" for c in "xyz"]

        def row(totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
            return {name: totals[f"reaction {name}"] for name in names}

        return Columns(
            names=names,
            at_frame=row,
            between=lambda before, totals, elapsed: row(totals, elapsed),
            units=dict.fromkeys(names, "N"),
            sums={f"reaction {self.name}": self.pull},
        )
