"""Damage at the start around the cuts of a sheet with a damage field: the profile of a crack, shared by near cuts.

A crack of length a has the damage d = (1 - r / 2 l)^2 at the distance r. Its energy is Gc a and, around each end, that
of half a disc: a cap of pi l / 4 times Gc. With the cap a tear begins at 0.94 of the energy release rate at which it
goes on (tools/tip_problem.py), and a tear from one cut to another, or to an edge, would take Gc times its way less two
caps. The damage therefore ends before the cut does, by a recess with which the cut has the energy of its length. Where
the ends of two cuts face each other or an edge, caps that overlap are counted once; an edge counts as the mirror image
of the cut. Energies are those on rows of points: `_cap`.
"""

from __future__ import annotations

import functools
from dataclasses import dataclass

import numpy as np

from ..device.checks import InputError, numbers
from ..geometry.couplings import (
    crack_segments,
    distance_from_segments,
    edge_segments,
    gradient_couplings,
    loose_ends,
)
from ..geometry.sheet import Sheet
from ..geometry.triangulation import components
from .field_constants import DEFAULT_LENGTH, SAME

# Gap between a cut and its mirror image in an edge, and between two cuts, in lengths of the field, beyond which caps
# take little: at FAR 5 % of the energy of the way. Cosine of the angle from the direction of a cut within which it
# faces another.
NEAR, FAR, AHEAD = 8.0, 32.0, np.cos(np.pi / 4.0)
# Recess of an end far from others, and least gap between cuts, in lengths, whose bridge tears as a crack advances.
CAP, OPEN = np.pi / 4.0, 4.0
# Energy of a tear over that of its way, and damage of a bridge at the start, from which a note says so.
ENOUGH, HURT = 0.9, 0.2
# Change of the damage below which the field at the start is at rest.
SETTLED = 1e-5


@dataclass(frozen=True, eq=False)
class CutEnds:
    """The ends of cuts inside a sheet.

    Attributes:
        segments: Segments of all cuts [m], shape (S, 2, dimensions).
        ends: Ends of cuts [m], shape (E, dimensions).
        gaps: Distance of each from the cut that it faces, or twice that from the edge that it faces [m]; infinite where
            it faces none. Shape (E,).
        mirrored: Whether each faces an edge, shape (E,).
        rooms: Length of its cut [m], divided by the number of its ends, shape (E,).
        between: Whether cuts run between points; otherwise points lie on both faces.
    """

    segments: np.ndarray
    ends: np.ndarray
    gaps: np.ndarray
    mirrored: np.ndarray
    rooms: np.ndarray
    between: bool

    @staticmethod
    def of(sheet: Sheet, length: float, far: float = FAR) -> CutEnds:
        """The ends; one faces a cut less than `far` lengths of a field [m] away, a mirror image less than NEAR."""
        segments = crack_segments(sheet)
        dimensions = segments.shape[-1]
        found = []
        edges = edge_segments(sheet)
        _, corner = np.unique(np.round(segments.reshape(-1, dimensions), 12), axis=0, return_inverse=True)
        corner = corner.reshape(-1, 2)
        cut = components(int(corner.max()) + 1, corner)[corner[:, 0]]
        for end in _inner(loose_ends(segments), edges, sheet):
            which, direction = _tip(segments, end)
            others = segments[cut != cut[which]]
            between, mirrored = _gap_ahead(others, end, direction), 2.0 * _gap_ahead(edges, end, direction)
            faces = between < far * length or mirrored < NEAR * length
            gap = min(between, mirrored) if faces else np.inf
            found.append((end, gap, faces and mirrored < between, int(cut[which])))
        own = np.array([index for *_, index in found], int)
        lengths = np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)
        rooms = [lengths[cut == index].sum() / (own == index).sum() for index in own]
        ends = np.array([end for end, *_ in found]).reshape(-1, dimensions)
        gaps, at_edge = np.array([gap for _, gap, *_ in found]), np.array([edge for *_, edge, _ in found], bool)
        return CutEnds(segments, ends, gaps, at_edge, np.array(rooms), bool(sheet.cuts))

    @property
    def facing(self) -> np.ndarray:
        """Whether each end faces a cut or an edge, shape (E,)."""
        return np.asarray(np.isfinite(self.gaps))

    @property
    def length(self) -> float:
        """Largest length of a field that cuts with bridges have room for, with which these start nearly intact [m]."""
        near = self.facing
        return float(np.min([self.rooms[near] / CAP, self.gaps[near] / OPEN], initial=np.inf))

    def cap(self, length: float, spacing: float) -> float:
        """Recess of an end far from others, in lengths of a field of a length [m] on points of a spacing [m]."""
        return _cap(round(length / spacing, 2), self.between)

    def recesses(self, length: float, spacing: float) -> np.ndarray:
        """Recess of each end [m], shape (E,), of a field of a length [m] on points of a spacing [m]."""
        gaps, ways = _ways()
        wanted = 0.5 * (np.interp(self.gaps / length, ways, gaps) - self.gaps / length)
        wanted = np.where(self.gaps > ways[-1] * length, CAP, wanted) * (self.cap(length, spacing) / CAP)
        return np.asarray(np.minimum(length * wanted, self.rooms))

    def shortened(self, length: float, spacing: float) -> np.ndarray:
        """The segments without what the recesses take [m], shape (S, 2, dimensions)."""
        segments = self.segments.copy()
        for end, recess in zip(self.ends, self.recesses(length, spacing), strict=True):
            left = recess
            while left > 1e-9 * recess:
                which, side = np.argwhere(np.linalg.norm(segments - end, axis=2) < 1e-9)[0]
                other = segments[which, 1 - side]
                whole = float(np.linalg.norm(other - end))
                taken = min(left, whole)
                segments[which, side] = end + taken / whole * (other - end)
                left -= taken
                if left > 1e-9 * recess:
                    end = other  # noqa: PLW2901
                    segments = np.delete(segments, which, axis=0)
        return segments

    def notes(self, length: float, bias: float, spacing: float, damage: np.ndarray, points: np.ndarray) -> list[str]:
        """A note on the bridge whose tear takes least of what it should, or that starts most damaged.

        A bridge tears without a tip that moves far, which would add what the energy of the field is divided by. There
        is no note on a field as short as it would expect.

        Args:
            length: Length of the field [m].
            bias: See `field_constants.bias`.
            spacing: Spacing of the sheet [m].
            damage: Damage at the start, (N,).
            points: Points of the sheet [m], (N, dimensions).
        """
        if not self.facing.any() or length <= SAME * self.length:
            return []
        recesses = self.recesses(length, spacing)
        gaps, ways = _ways()
        apart = self.gaps + 2.0 * recesses * CAP / self.cap(length, spacing)
        taken = np.full(len(self.ends), np.inf)
        taken[self.facing] = (length * np.interp(apart / length, gaps, ways) / self.gaps / bias)[self.facing]
        worst = int(np.argmin(taken))
        middle = self.ends[worst] + 0.5 * self.gaps[worst] * _tip(self.segments, self.ends[worst])[1]
        hurt = float(damage[np.argmin(np.linalg.norm(points - middle, axis=1))])
        if taken[worst] >= ENOUGH and hurt <= HURT:
            return []
        place = ", ".join(f"{x:.4g}" for x in middle)
        needed = self.length / DEFAULT_LENGTH
        edge, gap = self.mirrored[worst], self.gaps[worst]
        which, gap, what = ("a cut and the edge", 0.5 * gap, "edge") if edge else ("two cuts", gap, "bridge")
        finer = "" if SAME * needed >= spacing else f", which needs a spacing of {needed:.2g} m"
        return [
            f"{which} are {gap:.3g} m apart, {gap / length:.2g} lengths of the damage field: the {what} at ({place}) m "
            f"starts with a damage of {hurt:.2g}, and the tear between them takes some {taken[worst]:.0%} of the "
            f"tearing energy, at less force than an intact one; expected a length of at most {self.length:.3g} m{finer}"
        ]


def damage_of_cuts(sheet: Sheet, length: float) -> tuple[np.ndarray, np.ndarray, CutEnds]:
    """Damage around the cuts of a sheet, (N,), a mask of the points beyond their ends, and these ends."""
    cuts = CutEnds.of(sheet, length)
    segments = cuts.shortened(length, sheet.spacing) if len(cuts.ends) else cuts.segments
    apart = distance_from_segments(sheet.points, segments, 2.0 * length)
    damage = np.maximum(1.0 - apart / (2.0 * length), 0.0) ** 2
    from_end = distance_from_segments(sheet.points, np.stack(2 * [loose_ends(segments)], axis=1), length)
    ahead = from_end <= apart * (1.0 + 1e-9)
    if cuts.facing.any():
        damage = _at_rest(sheet, damage, length)
    return damage, ahead, cuts


def longest_between_cuts(sheet: Sheet) -> float:
    """Largest length that cuts near each other have room for [m]."""
    return CutEnds.of(sheet, DEFAULT_LENGTH * sheet.spacing, far=NEAR).length


def initial_damage(given: np.ndarray, size: int) -> np.ndarray:
    """`TearingEnergy.initial_damage`, checked, (N,). Raises InputError unless it is N numbers from 0 to 1."""
    damage = numbers("TearingEnergy.initial_damage", given)
    if damage.shape != (size,) or damage.min() < 0.0 or damage.max() > 1.0:
        found = f"{damage.min():g} to {damage.max():g}" if damage.shape == (size,) else f"shape {damage.shape}"
        raise InputError(f"TearingEnergy.initial_damage: expected {size} numbers from 0 to 1, got {found}")
    return damage


def _inner(ends: np.ndarray, edges: np.ndarray, sheet: Sheet) -> np.ndarray:
    """The ends that lie in the sheet, away from its edges."""
    inside = ((ends > sheet.points.min(axis=0)) & (ends < sheet.points.max(axis=0))).all(axis=1)
    if sheet.frames is not None:
        inside[:] = True
    apart = distance_from_segments(ends, edges, sheet.spacing)
    return np.asarray(ends[inside & (apart > 0.5 * sheet.spacing)])


def _tip(segments: np.ndarray, end: np.ndarray) -> tuple[int, np.ndarray]:
    """The segment with this loose end, and the direction in which it points there, a unit vector."""
    which, side = np.argwhere(np.linalg.norm(segments - end, axis=2) < 1e-9)[0]
    along = end - segments[which, 1 - side]
    return int(which), along / np.linalg.norm(along)


def _gap_ahead(segments: np.ndarray, end: np.ndarray, direction: np.ndarray) -> float:
    """Distance from an end of a cut to the nearest of other segments ahead of it [m]."""
    begin, along = segments[:, 0], segments[:, 1] - segments[:, 0]
    squared = np.maximum((along**2).sum(axis=1), 1e-300)
    fraction = (((end - begin) * along).sum(axis=1) / squared).clip(0.0, 1.0)
    apart = begin + fraction[:, None] * along - end
    gaps = np.linalg.norm(apart, axis=1)
    return float(gaps[apart @ direction >= AHEAD * gaps].min(initial=np.inf))


@functools.cache
def _ways() -> tuple[np.ndarray, np.ndarray]:
    """Gaps between two damaged lines, and the way whose energy a tear through each of them takes, in lengths."""
    places = (np.arange(400) + 0.5) / 200.0 - 1.0
    x, y = np.meshgrid(1.0 + places, 2.0 * places)
    stored = 0.75 * np.maximum(1.0 - 0.5 * np.hypot(x, y), 0.0) ** 2
    half = np.concatenate([[0.0], np.cumsum(stored.sum(axis=0)) * 0.005 * 0.01])
    gaps = np.append(0.01 * np.arange(401), FAR)
    return gaps, gaps - 2.0 * np.append(half, half[-1])


@functools.cache
def _cap(spacings: float, between: bool) -> float:
    """Recess with which a cut has the energy of its length, in lengths of a field of so many spacings.

    A line `between` two rows of points has less energy than in the continuum, one with points on both faces has more.
    """
    from scipy.optimize import brentq

    rows = np.ceil(2.0 * spacings) + 2.0
    y, x = np.arange(rows) + 0.5 * between, np.arange(-4.0 * rows, 2.0 * rows) + 0.5
    width = np.where(y == 0.0, 0.5, 1.0)[:, None]

    def energy(apart: np.ndarray) -> float:
        damage = np.maximum(1.0 - apart / (2.0 * spacings), 0.0) ** 2
        steps = (np.diff(damage, axis=0) ** 2).sum() + (width * np.diff(damage, axis=1) ** 2).sum()
        return float((width * damage).sum() + spacings**2 * steps)

    def excess(recess: float) -> float:
        return float(energy(np.hypot(np.maximum(x + recess * spacings, 0.0), y[:, None])) / line - 4.0 * rows)

    line = energy(y[:, None] + 0.0 * x) / len(x)
    return float(brentq(excess, 0.0, 2.0))


def _at_rest(sheet: Sheet, damage: np.ndarray, length: float) -> np.ndarray:
    """The least energy of the field above a damage, both (N,), without a load: kinks between near cuts smooth out."""
    near = np.flatnonzero(damage > 0.0).astype(np.int32)
    neighbours, couplings = gradient_couplings(sheet, near)
    couplings = couplings * 2.0 * length**2 / sheet.areas[near]
    least, total, found = damage[near], np.maximum(couplings.sum(axis=0), 1e-300), damage.copy()
    for _ in range(int(20.0 * (length / sheet.spacing) ** 2) + 20):
        new = np.maximum(least, np.minimum((couplings * found[neighbours]).sum(axis=0) / total - 1.0 / total, 1.0))
        change = np.abs(new - found[near]).max()
        found[near] = new
        if change < SETTLED:
            break
    return found
