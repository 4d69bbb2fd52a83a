"""The size of loads and reactions, with which an unbalanced force is compared."""

from __future__ import annotations

import math
from collections.abc import Callable

import warp as wp

from ..context import Context
from ..device.fields import Array, to_host
from ..device.launches import Stage
from ..kernels.statics.residual import residual


class LoadScale:
    """Loads and reactions of a state, without what the supports of a stressed sheet carried at the start.

    The reactions of prestress can exceed a load ten thousand times. An unbalanced force that is small against them may
    be the whole load: it must be small against what moves the sheet, too. A sheet that starts without stress has no
    arrays of its own for this.

    Attributes:
        initial: Internal force at the start of the run [N], (N,) vec3; None for a sheet without stress there.
    """

    def __init__(
        self, context: Context, owner: str, tolerance: float, accuracy: float, least: float = 0.0, stressed: bool = True
    ) -> None:
        """Allocate the sums.

        Args:
            context: The context.
            owner: Owner of the arrays.
            tolerance: Unbalanced force over loads and reactions in equilibrium.
            accuracy: The same over what moves a stressed sheet.
            least: The same over loads and reactions, below which any stressed sheet is in equilibrium.
            stressed: Whether the sheet may be stressed at the start.
        """
        self.context, self.owner, n = context, owner, context.sheet.size
        self._least, self._most = min(1.0, least / tolerance), max(1.0, accuracy / tolerance)
        self.reaction = context.array("reaction", owner, wp.float64, shape=n)
        self.initial: Array | None = None
        self._moving: Array | None = None
        if stressed and context.communicator.any(bool(context.initial_displacement.any())):
            self.initial = context.array("initial_force", owner, context.types.vec3, shape=n, restart=True)
            self._moving = context.array("moving_force", owner, wp.float64, shape=n)

    def add(self, stage: Stage, dead: Array | None, unbalanced: Array, squared: Array) -> None:
        """Add the launch of the unbalanced force, and of loads and reactions."""
        context, state, f = self.context, self.context.state, self.context.options
        kernel = residual(context.bits, f.held, f.loaded, dead is not None, self.initial is not None)
        stage.launch(
            self.owner, kernel, context.sheet.size, held_mask=state.held_mask, force=state.force,
            external=state.external, dead=dead, initial=self.initial, unbalanced=unbalanced, squared=squared,
            reaction=self.reaction, moving=self._moving,
        )  # fmt: skip

    @property
    def sums(self) -> dict[str, Array | None]:
        """Squared loads and reactions, and what moves a stressed sheet [N^2], by the arguments of `residual`."""
        return {"reaction": self.reaction, "moving": self._moving}

    def begin(self) -> None:
        """Store the internal force at the start of a run; a resumed run has it."""
        if self.initial is not None and not to_host(self.initial).any():
            wp.copy(self.initial, self.context.state.force)

    def size(self, total: Callable[[Array], float]) -> float:
        """Norm of loads and reactions [N], of a stressed sheet at most a multiple of what moves it.

        `total` sums an array of points.
        """
        size = math.sqrt(total(self.reaction))
        if self._moving is None:
            return size
        return max(min(size, self._most * math.sqrt(total(self._moving))), self._least * size)
