"""The force of a support, summed on the device, as columns of the history."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
import warp as wp

from ..device.checks import InputError, point_indices
from ..device.fields import Array
from ..device.launches import Stage
from ..interfaces import BuiltLaw, BuiltPart, Part
from ..interfaces.context import Context
from ..interfaces.phases import Phase
from ..kernels.loads import support_forces

OWNER = "Reaction"


@dataclass(frozen=True, eq=False)
class Reaction(Part):
    """Output of the force of a support on its points: columns NAME_x, NAME_y and NAME_z of the history [N].

    It does not change the simulation. The force is minus the sum of the internal force, as in
    `warp_pd.measures.support_force`, without inertia. It is summed on the device, so the rows between frames
    (`Explicit(history_every=)`) have it as well.

    Attributes:
        points: Point indices, such as those of a `Fixed` or a `Motion`.
        name: Prefix of the columns, a single word.
    """

    points: Any
    name: str = "reaction"

    def __post_init__(self) -> None:
        if not isinstance(self.name, str) or not self.name.isidentifier():
            raise InputError(f"Reaction.name = {self.name!r}: expected a single word, such as 'pull'")

    @property
    def only_one(self) -> str:
        """Its name."""
        return f"Reaction with the name {self.name!r}: expected different names"

    def build(self, context: Context, law: BuiltLaw) -> BuiltPart:
        """The sum on a device. Raises InputError if a point does not exist."""
        return BuiltReaction(self.name, np.asarray(point_indices("Reaction.points", self.points, context.sheet.size)),
                             context)  # fmt: skip


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
            kernel = support_forces(self.context.bits)
            force = self.context.state.force
            stage.launch(OWNER, kernel, len(self.points), points=self.points, force=force, out=self.pull)

    def sums(self) -> Mapping[str, Array]:
        """The sum over its points."""
        return {f"reaction {self.name}": self.pull}

    def column_names(self) -> Sequence[str]:
        """Components of the force."""
        return [f"{self.name}_{c}" for c in "xyz"]

    def columns(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Components of the force [N]."""
        return {name: totals[f"reaction {name}"] for name in self.column_names()}

    def row_columns(self, before: Mapping[str, float], totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Components of the force [N]."""
        return self.columns(totals, elapsed)

    def column_units(self) -> Mapping[str, str]:
        """Newton."""
        return dict.fromkeys(self.column_names(), "N")
