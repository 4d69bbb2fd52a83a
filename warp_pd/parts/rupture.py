"""Rupture: criteria, and the breaking of bonds, which is common to all criteria.

To write your own criterion, inherit from BondCriterion and provide its device function; see
docs/write-your-own-part.md.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, finite, point_indices
from ..device.fields import Array
from ..device.launches import Stage
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, BuiltRupture, Columns, History, Rupture
from ..interfaces.scales import Scales, of_stretch
from ..kernels.rupture import SCREENED, Criterion, breaking, critical_stretch, face_damage, point_damage, screening
from ..step import Phase

# Beyond it the squares of stretches overflow in float32.
MAX_STRETCH = 1e12
# When static solvers run the stages of rupture.
AT_REST = "whenever the sheet is in static equilibrium"


class BondCriterion(Rupture):
    """A criterion evaluated for each bond separately (base class)."""

    divides = True

    @property
    def squared_stretch(self) -> float | None:
        """Squared stretch |Y|^2/|X|^2 [-] below which no bond exceeds the criterion, or None without such a bound."""
        return None

    def criterion(self, context: Context, law: BuiltLaw) -> tuple[Criterion, Any]:
        """The device function of the criterion, and its struct filled in; see kernels/rupture.py."""
        raise NotImplementedError(
            f"{type(self).__name__}.criterion: expected an implementation that returns a device function"
        )

    def build(self, context: Context, law: BuiltLaw) -> BuiltRupture:
        """Build the criterion on a device."""
        return BreakingBonds(type(self).__name__, self, context, law)


@dataclass(frozen=True, eq=False)
class CriticalStretch(BondCriterion):
    """A bond breaks permanently when its stretch |Y|/|X| exceeds a critical value. Source: BA and NN papers.

    The released energy is the drop of the strain energy at the moment of breaking. It is usually positive, but can be
    slightly negative where a damaged family retains its most strained intersections.

    Attributes:
        stretch: Critical stretch s_c, greater than 1.
        spared: Points whose bonds never break, such as those in a clamp; None for none.

    Raises:
        InputError: if the stretch is not greater than 1 or is too large.
    """

    stretch: float
    spared: Any = None

    def __post_init__(self) -> None:
        if not 1.0 < finite("CriticalStretch.stretch", self.stretch) < MAX_STRETCH:
            raise InputError(
                f"CriticalStretch.stretch = {self.stretch!r}: expected a stretch greater than 1 and less than "
                f"{MAX_STRETCH:g}"
            )

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Whether no rubber reaches it."""
        return of_stretch("CriticalStretch.stretch", self.stretch)

    @property
    def squared_stretch(self) -> float:
        """The squared critical stretch."""
        return self.stretch**2

    def criterion(self, context: Context, law: BuiltLaw) -> tuple[Criterion, Any]:
        """The squared critical stretch."""
        found = critical_stretch(context.layout)
        values = found.struct()
        values.squared = self.squared_stretch
        return found, values


class Opening(Protocol):
    """Cuts that open while a run goes on, before the bonds that exceed a criterion break."""

    def add(self, stage: Stage) -> None:
        """Add the launch that cuts the bonds that are due."""
        ...

    def notes(self, history: History) -> list[str]:
        """Notes on cuts that the run has not reached."""
        ...


class Damaged(BuiltRupture):
    """Damage of the sheet by broken bonds (base class).

    Attributes:
        opening: Cuts in time beside the criterion, or None.
        spared: Whether each point is spared, (N,) uint8, or None.
        released: Energy released by broken bonds [J], (N,) float64; None if it is not tracked.
        tracked_energy: Warp function of the family energy whose loss is tracked, or None.
        intact: The bits of intact bonds.
    """

    opening: Opening | None = None

    def __init__(self, owner: str, rupture: Rupture, context: Context, law: BuiltLaw) -> None:
        self.label, self.owner, self.context, self.law = f"damage = {owner}", owner, context, law
        sheet = context.sheet
        self.spared: Array | None = None
        if rupture.spared is not None:
            mask = np.zeros(context.whole.size, np.uint8)
            mask[point_indices(f"{owner}.spared", rupture.spared, len(mask))] = 1
            self.spared = context.array("spared", owner, wp.uint8, context.here(mask))
        tracked = context.options.tracked and law.has_energy
        self.released: Array | None = None
        if tracked:
            self.released = context.array("released", "energy balance", wp.float64, shape=sheet.size, restart=True)
        self.tracked_energy = law.earlier_energy if tracked else None
        assert law.intact is not None
        self.intact = law.intact
        self.damage = context.array("damage", owner, wp.float32, shape=sheet.size)
        self.intact_faces = context.array("intact_faces", owner, wp.uint8, shape=len(sheet.triangles), per="face")
        self._triangles = context.array("triangles", owner, wp.vec3i, sheet.triangles, per="table")
        self._motion: tuple[Array, Array] | None = None
        self._asked = False

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch that breaks bonds, or those of the damage at frames."""
        if phase is Phase.RUPTURE:
            if self.opening is not None:
                self.opening.add(stage)
            self.add_breaking(stage)
        elif phase is Phase.FRAME:
            self._add_damage(stage)

    def add_breaking(self, stage: Stage) -> None:
        """Add the launch that breaks bonds."""
        raise NotImplementedError(
            f"{type(self).__name__}.add_breaking: expected an implementation that launches a kernel"
        )

    def prepare_at_rest(self, moved: Array | None = None) -> None:
        """Compose the stages that cut and break bonds in equilibrium.

        The released energy depends on the displacement since the begin of a step, `moved` [m].
        """
        if moved is not None:
            context = self.context
            self._motion = moved, context.array("unit_time", self.owner, context.types.real, np.ones(1), per="table")

        if self.opening is not None:
            self.opening.add(self.context.stage("cuts in time", AT_REST))
        self.compose_breaking()

    def compose_breaking(self) -> None:
        """Compose the stages of `break_exceeding`."""
        self.add_breaking(self.context.stage("rupture", AT_REST))

    def break_at_rest(self, again: bool) -> bool:
        """Cut what is due; in the equilibrium that follows, break what exceeds the criterion."""
        if self.opening is None:
            return self.break_exceeding(again)
        # The criterion has not been asked at these loads while cuts opened.
        asked, self._asked = again and self._asked, False
        before = self.intact.numpy().copy()
        self.context.run("cuts in time")
        if (self.intact.numpy() != before).any():
            return True
        self._asked = True
        return self.break_exceeding(asked)

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on cuts."""
        return [] if self.opening is None else self.opening.notes(history)

    def break_exceeding(self, again: bool) -> bool:
        """Break the bonds that exceed the criterion, and return whether there were any."""
        before = self.intact.numpy().copy()
        self.context.run("rupture")
        return bool((self.intact.numpy() != before).any())

    def arguments(self) -> dict[str, Any]:
        """Arguments common to the kernels that break bonds."""
        law, state = self.law, self.context.state
        velocity, step = self._motion or (state.velocity, state.step)
        return {
            "family": law.struct, "displacement": state.displacement, "velocity": velocity, "step": step,
            "constants": law.energy_constants, "unit_volume": law.unit_volume, "released": self.released,
        }  # fmt: skip

    def _add_damage(self, stage: Stage) -> None:
        stage.launch(
            self.owner, point_damage(self.context.layout), self.context.sheet.size, family=self.law.struct,
            out=self.damage,
        )  # fmt: skip
        self.add_faces(stage)

    def add_faces(self, stage: Stage) -> None:
        """Add the launch that finds the triangles not cut by a crack."""
        stage.launch(
            self.owner, face_damage(self.context.layout), len(self.context.sheet.triangles), family=self.law.struct,
            triangles=self._triangles, intact_faces=self.intact_faces,
        )  # fmt: skip

    def columns(self) -> Columns:
        """Largest and mean damage; the energy lost with broken bonds, and to a damage field."""
        lost = {} if self.released is None else {"rupture": self.released}
        return Columns(("largest_damage", "mean_damage"), self.damage_row, lost=lost)

    def damage_row(self, totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
        """Largest and mean damage."""
        return self.means(self.context.whole_array(self.damage))

    def means(self, damage: np.ndarray) -> dict[str, float]:
        """Largest and mean damage of all points, (N,)."""
        return {"largest_damage": float(damage.max()), "mean_damage": float(damage.mean(dtype=np.float64))}


class BreakingBonds(Damaged):
    """Bonds that break by a bond criterion.

    Attributes:
        criterion: Filled struct of the criterion.
        screens: Whether, on a CPU, each lattice bond is checked once before bonds are broken.
    """

    screens = True

    def __init__(self, owner: str, rupture: BondCriterion, context: Context, law: BuiltLaw) -> None:
        super().__init__(owner, rupture, context, law)
        found, self.criterion = rupture.criterion(context, law)
        self._limit = rupture.squared_stretch
        on_lattice = context.layout.kind == "lattice" and context.partition is None
        screened = self.screens and on_lattice and not context.device.is_cuda
        self._screen = screening(context.layout, found) if screened else None
        self._kernel = breaking(context.layout, found, self.spared is not None, screened, self.tracked_energy)

    def add_breaking(self, stage: Stage) -> None:
        """Add the launches that break bonds."""
        size, arguments, exceeding = self.context.sheet.size, self.arguments(), None
        if self.tracked_energy is None:
            # The kernel then has no energy that reads them, and does not know how many there are.
            arguments["constants"] = self.context.types.parameters()
        if self._screen is not None:
            blocks = -(-size // SCREENED)
            exceeding = self.context.array("exceeding", self.owner, wp.uint8, shape=blocks, per="block")
            if self._limit is None or not self.law.screen_with_force(stage, self._limit, exceeding):
                stage.launch(
                    self.owner, self._screen, blocks, criterion=self.criterion, exceeding=exceeding,
                    family=self.law.struct, displacement=self.context.state.displacement,
                )  # fmt: skip
        stage.launch(
            self.owner, self._kernel, size, **arguments, spared_mask=self.spared, criterion=self.criterion,
            exceeding=exceeding,
        )  # fmt: skip
