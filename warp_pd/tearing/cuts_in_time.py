"""Cuts that open while a run goes on: slits, seams and punched holes, each at its time. See docs/tearing.md."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError, finite, implements, numbers, point_indices, positive, show, vector
from ..device.clock import Schedule
from ..device.fields import Array
from ..device.launches import Stage
from ..geometry.sheet import Sheet
from ..geometry.triangulation import crosses
from ..interfaces import BuiltLaw, BuiltRupture, History, Law, Part, Rupture
from ..interfaces.scales import Scales
from ..kernels.tearing.cuts_in_time import cut_bonds
from ..laws.bond_associated import with_weights_of_intact_sheets
from ..parts.rupture import Damaged
from ..shapes.edits import tips_of

OWNER = "CutsInTime"
# A cut is due this fraction of its time early: the round-off of load steps.
EARLY = 1e-9


class Cut(Protocol):
    """A cut that opens in time."""

    def times(self, sheet: Sheet, tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        """Times at which bonds between two points are cut [s], infinite for those that stay; all of shape (B,).

        It is the same for a bond and its reverse.
        """
        ...

    def first(self) -> float:
        """Time at which it begins to open [s]."""
        ...


@dataclass(frozen=True, eq=False)
class Slit:
    """A cut along a path in a flat sheet, as `Sheet.cut` makes it before a run.

    Attributes:
        path: Two or more positions [m], shape (L, 2), straight between them.
        at: Time at which it opens [s], or the two times at which it begins at its first and arrives at its last
            position. In static solvers times are load times.

    Raises:
        InputError: if the path has no length, or times are negative or do not increase.
    """

    path: Any
    at: Any

    def __post_init__(self) -> None:
        path = numbers("Slit.path", self.path)
        if path.ndim != 2 or path.shape[0] < 2 or path.shape[1] != 2:
            raise InputError(f"Slit.path: expected two or more positions (x, y), got shape {path.shape}")
        if not np.linalg.norm(np.diff(path, axis=0), axis=1).all():
            raise InputError(f"Slit.path = {path.tolist()}: expected no position twice in a row")
        self._span()

    def _span(self) -> np.ndarray:
        """Begin and end [s], shape (2,)."""
        span = np.atleast_1d(numbers("Slit.at", self.at))
        if span.shape not in ((1,), (2,)) or span[0] < 0.0 or span[-1] < span[0]:
            raise InputError(f"Slit.at = {show(self.at)}: expected a time, or two in order, from 0 on")
        return np.array([span[0], span[-1]])

    def first(self) -> float:
        """Time at which it begins to open [s]."""
        return float(self._span()[0])

    def times(self, sheet: Sheet, tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        """Times at which bonds are cut [s], (B,). Raises InputError for a curved sheet."""
        if sheet.frames is not None:
            raise InputError("Slit: expected a flat sheet; use Seam for points of a curved one")
        path, (begin, end) = np.asarray(self.path, float), self._span()
        lengths = np.linalg.norm(np.diff(path, axis=0), axis=1)
        before, found = 0.0, np.full(len(tails), np.inf)
        one, other = sheet.points[np.minimum(tails, heads)], sheet.points[np.maximum(tails, heads)]
        for k, length in enumerate(lengths):
            start, stop = path[k], path[k + 1]
            segment = ((float(start[0]), float(start[1])), (float(stop[0]), float(stop[1])))
            inner = tips_of(sheet, segment)[-1]
            cut = crosses(one, other, segment, (inner[0] and k == 0, inner[1] and k == len(lengths) - 1))
            share = (before + _along(one[cut], other[cut], start, stop)) / lengths.sum()
            found[cut] = np.minimum(found[cut], begin + (end - begin) * share.clip(0.0, 1.0))
            before += float(length)
        return found


def _along(tails: np.ndarray, heads: np.ndarray, start: np.ndarray, stop: np.ndarray) -> np.ndarray:
    """Distance from the start of a segment [m] at which bonds cross it, (B,); of bonds along it of their middle."""
    along = (stop - start) / np.linalg.norm(stop - start)
    a, b = tails - start, heads - start
    above, below = along[0] * a[:, 1] - along[1] * a[:, 0], along[0] * b[:, 1] - along[1] * b[:, 0]
    apart = above - below
    fraction = np.where(apart == 0.0, 0.5, above / np.where(apart == 0.0, 1.0, apart))
    return np.asarray((a + fraction[:, None] * (b - a)) @ along)


@dataclass(frozen=True, eq=False)
class Seam:
    """A seam between two groups of points that opens: all bonds from one group to the other are cut.

    Attributes:
        one: Indices of points, or their mask.
        other: Likewise.
        at: Time at which it opens [s], or a time for each point of `one` in ascending order, infinite where it stays
            closed. In static solvers times are load times.

    Raises:
        InputError: if times are negative.
    """

    one: Any
    other: Any
    at: Any

    def __post_init__(self) -> None:
        try:
            at = np.asarray(self.at, float)
        except (TypeError, ValueError):
            raise InputError(f"Seam.at = {show(self.at)}: expected times from 0 on") from None
        if at.ndim == 0:
            finite("Seam.at", self.at)
        if at.size == 0 or np.isnan(at).any() or (at < 0.0).any() or at.ndim > 1:
            raise InputError(f"Seam.at = {show(self.at)}: expected times from 0 on")

    def first(self) -> float:
        """Time at which it begins to open [s]."""
        return float(np.min(self.at))

    def times(self, sheet: Sheet, tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        """Times at which bonds are cut [s], (B,). Raises InputError if groups share points or times are not theirs."""
        one = np.unique(point_indices("Seam.one", self.one, sheet.size))
        other = np.unique(point_indices("Seam.other", self.other, sheet.size))
        if np.intersect1d(one, other).size:
            raise InputError("Seam: one and other share points; expected two groups apart")
        if np.ndim(self.at) and np.shape(self.at) != one.shape:
            raise InputError(
                f"Seam.at: expected a time for each of the {len(one)} points of one, got {np.shape(self.at)}"
            )
        opens, across = np.full(sheet.size, np.inf), np.zeros(sheet.size, bool)
        opens[one], across[other] = self.at, True
        return np.where(across[heads], opens[tails], np.where(across[tails], opens[heads], np.inf))


@dataclass(frozen=True, eq=False)
class Punch:
    """A hole that is punched: points closer than `radius` to `centre` lose all bonds, and what is left of them is dust.

    Attributes:
        centre: Position in the undeformed sheet [m], shape (2,), of a curved sheet (3,).
        radius: Radius [m].
        at: Time at which it is punched [s]; in static solvers, which need points that are held, the load time.

    Raises:
        InputError: if the radius is not positive or the time is negative.
    """

    centre: Any
    radius: float
    at: float

    def __post_init__(self) -> None:
        positive("Punch.radius", self.radius)
        if finite("Punch.at", self.at) < 0.0:
            raise InputError(f"Punch.at = {self.at!r}: expected a time from 0 on")

    def first(self) -> float:
        """Time at which it is punched [s]."""
        return float(self.at)

    def times(self, sheet: Sheet, tails: np.ndarray, heads: np.ndarray) -> np.ndarray:
        """Times at which bonds are cut [s], (B,)."""
        centre = vector("Punch.centre", self.centre, sheet.points.shape[1])
        inside = np.linalg.norm(sheet.points - centre, axis=1) < self.radius * (1.0 - 1e-9)
        return np.where(inside[tails] | inside[heads], self.at, np.inf)


@dataclass(frozen=True, eq=False)
class CutsInTime(Rupture):
    """Cuts that open at their times, alone or beside a criterion by which the sheet tears from then on.

    What the cut bonds stored is in the column `rupture` of the history. A cut has no damage of a damage field around
    it: it is a notch, from which a tear starts at 1.2 to 1.3 Gc, as one of `TearingEnergy(cut_profile=False)` does.

    Attributes:
        cuts: A `Slit`, `Seam` or `Punch`, or several of them.
        beside: Another criterion, such as TearingEnergy; None if nothing else breaks.

    Raises:
        InputError: if there is no cut, or `beside` is no criterion or has cuts itself.
    """

    cuts: Cut | Sequence[Cut]
    beside: Rupture | None = None

    def __post_init__(self) -> None:
        if not self.each or not all(isinstance(cut, (Slit, Seam, Punch)) for cut in self.each):
            raise InputError(f"CutsInTime.cuts = {show(self.cuts)}: expected a Slit, Seam or Punch, or a list of them")
        if not implements(self.beside, Rupture | None) or isinstance(self.beside, CutsInTime):
            raise InputError(
                f"CutsInTime.beside = {show(self.beside)}: expected a criterion, such as TearingEnergy, or None"
            )

    @property
    def each(self) -> tuple[Cut, ...]:
        """The cuts."""
        return tuple(self.cuts) if isinstance(self.cuts, Sequence) else (self.cuts,)

    @property
    def spared(self) -> Any:
        """Points whose bonds break by cuts alone."""
        return None if self.beside is None else self.beside.spared

    @property
    def is_field(self) -> bool:  # type: ignore[override]
        """Whether a damage field is beside them."""
        return self.beside is not None and self.beside.is_field

    def law(self, force: Law, context: Context) -> Law:
        """The force law as the criterion needs it; alone, cuts leave the sheet before them as it is without."""
        return with_weights_of_intact_sheets(force) if self.beside is None else self.beside.law(force, context)

    def check(self, others: Sequence[Part]) -> None:
        """Raise InputError for parts that cannot be combined with the criterion."""
        if self.beside is not None:
            self.beside.check(others)

    def doubts(self, sheet: Sheet, scales: Scales) -> Sequence[str]:
        """Sizes of the criterion that cannot be meant."""
        return () if self.beside is None else self.beside.doubts(sheet, scales)

    def build(self, context: Context, law: BuiltLaw) -> BuiltRupture:
        """Build cuts and criterion on a device."""
        built = NothingElse(OWNER, self, context, law) if self.beside is None else self.beside.build(context, law)
        if not isinstance(built, Damaged):
            raise InputError(
                f"CutsInTime.beside = {show(self.beside)}: expected a criterion whose `build` returns a Damaged, as "
                "that of BondCriterion does"
            )
        built.opening = OpeningCuts(self, context, law, built.released)
        # A path by arc length has no time at which a cut is due; ArcLength refuses what has no energy of a tear.
        built.label, built.tear_energy = f"damage = {OWNER}", 0.0
        return built


class NothingElse(Damaged):
    """Damage by cuts alone."""

    def add_breaking(self, stage: Stage) -> None:
        """No bond breaks by itself."""

    def compose_breaking(self) -> None:
        """Nothing to compose."""

    def break_exceeding(self, again: bool) -> bool:
        """No bond breaks by itself."""
        return False


class OpeningCuts:
    """Cuts in time on a device.

    Attributes:
        points: Points with bonds that are cut, (P,) int32.
        times: Times of their bonds [s], (members, P) float64.
    """

    def __init__(self, rupture: CutsInTime, context: Context, law: BuiltLaw, released: Array | None) -> None:
        self.context, self.law, self.rupture, self._released = context, law, rupture, released
        points, times = self._opening(context.given)
        self.points = context.array("cut_points", OWNER, wp.int32, points, per="table")
        self.times = context.array("cut_times", OWNER, wp.float64, (1.0 - EARLY) * times.T, per="table")
        context.clock.register(Schedule(np.array([0.0]), np.zeros((1, 3)), OWNER))

    def _opening(self, sheet: Sheet) -> tuple[np.ndarray, np.ndarray]:
        """Points with bonds that are cut, (P,), and the times of these [s], (P, members).

        Raises:
            InputError: for a cut without a bond, one through a rigid inclusion, and one that another has made before.
        """
        families = self.law.families
        members = families.members_of(np.arange(sheet.size))
        tail, member = np.nonzero(members >= 0)
        head, found = members[tail, member], np.full(members.shape, np.inf)
        maker = np.full(members.shape, -1)
        for number, cut in enumerate(self.rupture.each):
            times = cut.times(sheet, tail, head)
            if not np.isfinite(times).any():
                raise InputError(
                    f"{cut!r}: cuts no bond; expected a place inside the sheet, that passes between points and is not "
                    "cut before the run"
                )
            opens = np.isfinite(times)
            sheet.require_beside_bodies(repr(cut), tail[opens], head[opens])
            earlier = times < found[tail, member]
            maker[tail[earlier], member[earlier]] = number
            found[tail, member] = np.minimum(found[tail, member], times)
        if len(idle := np.setdiff1d(np.arange(len(self.rupture.each)), maker)):
            raise InputError(
                f"{self.rupture.each[idle[0]]!r}: by then other cuts have opened all its bonds: expected each cut once"
            )
        points = np.flatnonzero(np.isfinite(found).any(axis=1))
        return points, found[points]

    def add(self, stage: Stage) -> None:
        """Add the launch that cuts the bonds that are due."""
        state, law = self.context.state, self.law
        energy = None if self._released is None else law.earlier_energy
        stage.launch(
            OWNER, cut_bonds(self.context.layout, energy), len(self.points), family=law.struct,
            displacement=state.displacement, velocity=state.velocity, step=state.step,
            constants=self.context.types.parameters() if energy is None else law.energy_constants,
            unit_volume=law.unit_volume, damage=law.damage, points=self.points, times=self.times,
            time=self.context.clock.time, released=self._released,
        )  # fmt: skip

    def notes(self, history: History) -> list[str]:
        """Notes on cuts that the run has not reached."""
        late = [cut for cut in self.rupture.each if cut.first() * (1.0 - EARLY) > history[-1]["time"]]
        return [f"{show(cut)} has not opened: the run ended at {history[-1]['time']:.3g} s" for cut in late]
