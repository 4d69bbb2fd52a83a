"""Checks for cases that contact does not prevent: overlapping bodies, and thin bodies passing between points."""

from __future__ import annotations

import itertools
from collections.abc import Callable, Container, Sequence
from typing import Protocol

import numpy as np
import warp as wp

from ..context import Context
from ..device.fields import Array
from ..interfaces import HELD, BuiltLaw, BuiltPart, History
from ..interfaces.frame import Body
from ..kernels.integrate import RIGID
from .body_shapes import BodyShape

# Smallest diameter in spacings, below which a body passes between points.
MIN_DIAMETER = 1.42
# Round-off of a point on a side of a triangle.
ON_A_SIDE = 1e-9
# Places looked at while a point moves by the thickness of a body, and at most.
PLACES, MOST_PLACES = 8, 1000
# Part of the energy there by which the loss of a body may lie below zero, and by which it may fall: while points are in
# contact it oscillates, by up to 5 % of coarse sheets under a free ball.
BELOW, FALLEN = 1e-3, 0.1
# Depth in a body at which points that ignore it are noted [spacings].
INSIDE = 0.01
# Halvings of the time at which the plane of a triangle crosses the centre of a body.
BISECTIONS = 40


def ignoring(held: np.ndarray) -> np.ndarray:
    """Whether points with held bits (see `State.held_mask`) ignore bodies: nothing of them is free, or they are in a
    rigid inclusion.
    """
    return np.asarray((held & (HELD | RIGID)) >= HELD)


class Solid(Protocol):
    """A rigid body that is compared with the others and with the sheet at every frame.

    Attributes:
        label: Its name in messages.
        meets_others: Whether it feels other bodies of which this is true.
        between_points: Whether it could pass between points, because contact acts only at points.
        thickness: Smallest extent [m]; None if it is unbounded.
    """

    label: str
    meets_others: bool
    between_points: bool
    thickness: float | None

    def outline(self) -> Body:
        """As `BuiltContact.outline`."""
        ...

    def pose(self) -> np.ndarray:
        """As `BuiltContact.pose`."""
        ...

    def distance_from(self, points: np.ndarray) -> np.ndarray:
        """Signed distances [m], shape (N,), of points, shape (N, 3), from it at a frame."""
        ...


def created(history: History, names: Sequence[str]) -> tuple[float, float, float, float] | None:
    """Energy that contact with bodies created: their loss is never negative, and falls only in small oscillations.

    It is their sum that counts: bodies that overlap push a point to and fro, and what one gives the other takes.

    Args:
        history: Rows with the columns NAME_loss.
        names: Names of the bodies.

    Returns:
        The energy created [J], the energy there [J] (of motion, stored since the start, lost in this contact), and the
        times of the two frames between which most was created [s]; None if there is none.
    """
    stored = [sum(row.get(kind, 0.0) for kind in ("strain", "contact")) for row in history]
    moving = [
        row.get("half_step_kinetic", 0.0) + sum(row.get(f"{name}_kinetic", 0.0) for name in names) for row in history
    ]
    loss = np.array([sum(row[f"{name}_loss"] for name in names) for row in history])
    most = np.maximum.accumulate(np.maximum(loss, 0.0))
    there = np.maximum.accumulate(np.abs(moving) + np.abs(np.subtract(stored, stored[0])) + most)
    fallen = most - loss
    found = (fallen > FALLEN * there) | (-loss > BELOW * there)
    if not found.any():
        return None
    worst = int(np.where(found, fallen, 0.0).argmax())
    step = int(np.diff(loss[: worst + 1]).argmin())
    return float(fallen[worst]), float(there[worst]), history[step]["time"], history[step + 1]["time"]


class BodyChecks(BuiltPart):
    """Checks bodies against each other and the stretched sheet at every frame, and reports problems as notes.

    The results are stored in a field, so that a resumed run has the same notes as an uninterrupted one.

    Attributes:
        bodies: The bodies of the scene.
    """

    label = "contact"

    def __init__(self, context: Context, law: BuiltLaw, bodies: Sequence[Solid]) -> None:
        self.context, self.law, self.bodies = context, law, bodies
        self._drawn = {body.label: body.outline() for body in self.bodies}
        corners, ignored = context.sheet.triangles, ignoring(context.held)
        inside = np.isin(np.arange(context.sheet.size), np.concatenate([[], *context.sheet.inclusions]))
        kinds = {"rigid": inside, "held": (context.held & HELD != 0) & ~ignored & ~inside}
        self._ignoring = {kind: np.flatnonzero(chosen) for kind, chosen in kinds.items() if chosen.any()}
        rigid = of_any_corner(inside, corners)
        faces = {"rigid": rigid, "fixed": ignored[corners].all(axis=1) & ~rigid}
        self._let_through = {kind: corners[chosen] for kind, chosen in faces.items() if chosen.any()}
        self._felt = corners[~(faces["rigid"] | faces["fixed"])] if self._let_through else corners
        self._texts = self._possible()
        # The number of frames, and the number of the one at which each was found first, or 0.
        self._found = context.array(
            "body_findings", "contact", wp.int32, shape=1 + len(self._texts), per="once", restart=True
        )
        # The largest depth of points that ignore each body.
        self._depths: Array | None = None
        if self._ignoring:
            self._depths = context.array(
                "body_depths", "contact", wp.float64, shape=len(self._texts), per="once", restart=True
            )
        self._before: tuple[np.ndarray, dict[str, np.ndarray]] | None = None
        self._at_start = bond_bits(law)

    def _possible(self) -> dict[tuple[str, ...], str]:
        """All possible notes, by subject."""
        texts: dict[tuple[str, ...], str] = {}
        for one, other in self._independent():
            texts[one.label, other.label] = (
                f"{one.label} and {other.label} overlap: rigid bodies do not interact with each other"
            )
        for body in self.bodies:
            texts["thin", body.label] = (
                f"{body.label} is {body.thickness or 0.0:.3g} m thick, and points near it are more than "
                f"1/{MIN_DIAMETER:g} of that apart: it may pass between them, without surface=True"
            )
            texts["passed", body.label] = (
                f"{body.label} passed through the sheet without breaking it: "
                "expected surface=True, a thicker body, or more points"
            )
            texts["rigid", body.label] = (
                f"{body.label} went into a rigid inclusion of the sheet, whose points ignore bodies: expected a body "
                "that stays off it, or Sheet.stiffened in place of the inclusion"
            )
            texts["held", body.label] = (
                f"{body.label} went into points that supports hold nearly along its normal, and ignore it: expected "
                "supports that let them yield"
            )
            texts["fixed", body.label] = f"{body.label} passed through held points, which ignore bodies"
        absent = {"rigid", "held", "fixed"} - {*self._ignoring, *self._let_through}
        return {key: text for key, text in texts.items() if key[0] not in absent}

    def end_frame(self) -> None:
        """Run the checks for this frame."""
        found = self._found.numpy()
        found[0] += 1
        met = self._overlaps()
        # Of a divided sheet, a process has a part alone.
        if self.context.partition is None and len(self.context.sheet.triangles):
            met |= self._compare_with_sheet()
        for index, key in enumerate(self._texts):
            if key in met and not found[1 + index]:
                found[1 + index] = found[0]
        self._found.assign(found)

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """Notes on the problems found, each with the time of its first occurrence."""
        _, *frames = self._found.numpy().tolist()
        found = {key: frame for key, frame in zip(self._texts, frames, strict=True) if frame}
        times = {key: history[min(frame, len(history)) - 1]["time"] for key, frame in found.items()}
        created = [note for labels in self._overlapping(found) for note in self._created(labels, history)]
        deep = {} if self._depths is None else dict(zip(self._texts, self._depths.numpy().tolist(), strict=True))
        places = {key: f", up to {deep[key]:.3g} m deep" if deep.get(key) else "" for key in times}
        return [*created, *(f"{self._texts[key]} (at {time:.4g} s{places[key]})" for key, time in times.items())]

    def _overlapping(self, found: Container[tuple[str, ...]]) -> list[list[str]]:
        """Labels of the bodies, those together that have overlapped."""
        groups = [[body.label] for body in self.bodies]
        for one, other in self._independent():
            if (one.label, other.label) in found:
                met = [group for group in groups if {one.label, other.label} & set(group)]
                groups = [group for group in groups if group not in met] + [[label for group in met for label in group]]
        return groups

    def _created(self, labels: Sequence[str], history: History) -> list[str]:
        """A note if contact with bodies that push the same points created energy."""
        names = {label: self._drawn[label].name for label in labels}
        names = {label: name for label, name in names.items() if f"{name}_loss" in history[0]}
        found = created(history, list(names.values())) if names else None
        if found is None:
            return []
        energy, there, begin, end = found
        losses = " and ".join(f"{name}_loss" for name in names.values())
        fell = f"{losses} fell" if len(names) == 1 else f"the sum of {losses} fell"
        return [
            f"{' and '.join(names)} created an energy of {energy:.3g} J, where there were {there:.3g} J, most of it "
            f"from {begin:.4g} to {end:.4g} s: {fell}. A point that two bodies push may get such energy: expected "
            "room for the sheet between them; what came later is not to be trusted"
        ]

    def _independent(self) -> list[tuple[Solid, Solid]]:
        """Pairs of bodies that do not feel each other."""
        pairs = itertools.combinations(self.bodies, 2)
        return [(a, b) for a, b in pairs if not (a.meets_others and b.meets_others)]

    def _overlaps(self) -> set[tuple[str, ...]]:
        return {(a.label, b.label) for a, b in self._independent() if max(self._depth(a, b), self._depth(b, a)) > 0.0}

    def _depth(self, one: Solid, other: Solid) -> float:
        """Largest depth [m] of the vertices of a body in another body; vertices of unbounded bodies are ignored."""
        if one.thickness is None:
            return 0.0
        return -float(other.distance_from(self._drawn[one.label].placed(one.pose())).min(initial=0.0))

    def _compare_with_sheet(self) -> set[tuple[str, ...]]:
        sheet = self.context.sheet
        u = np.asarray(self.context.state.displacement.numpy(), np.float64)
        position, corners = sheet.positions + u, sheet.triangles
        torn = torn_since(self._at_start, self.law)
        # The sides of a tear are far apart, and a body between them passes no sheet.
        whole = corners if torn is None else corners.compress(~of_any_corner(torn, corners), axis=0)
        centres: dict[str, np.ndarray] = {}
        met: set[tuple[str, ...]] = set()
        for body in self.bodies:
            thickness, pose = body.thickness, body.pose()
            met |= self._inside_of(body, position)
            if thickness is None:
                continue
            centres[body.label] = pose[:3]
            if body.between_points and self._is_thin(body, thickness, position, whole):
                met.add(("thin", body.label))
            if self._before is not None and body.label in self._before[1]:
                before, centre = self._before[0], self._before[1][body.label]
                ends = before - centre, position - pose[:3]
                if passes(*ends, self._felt, torn):
                    met.add(("passed", body.label))
                for kind, through in self._let_through.items():
                    if passes(*ends, through, torn):
                        met.add((kind, body.label))
        self._before = position, centres
        return met

    def _inside_of(self, body: Solid, position: np.ndarray) -> set[tuple[str, ...]]:
        """Which points that ignore a body are inside it."""
        if self._depths is None:
            return set()
        met, depths, least = set(), self._depths.numpy(), INSIDE * self.context.sheet.spacing
        for index, key in enumerate(self._texts):
            if key[0] in self._ignoring and key[1] == body.label:
                depth = -float(body.distance_from(position[self._ignoring[key[0]]]).min())
                if depth > least:
                    depths[index] = max(depths[index], depth)
                    met.add(key)
        self._depths.assign(depths)
        return met

    def _is_thin(self, body: Solid, thickness: float, position: np.ndarray, corners: np.ndarray) -> bool:
        """Whether the points of a triangle that is nearer to a body than its thickness [m] are too far apart for it."""
        reach = thickness + float(np.linalg.norm(self._drawn[body.label].vertices, axis=1).max())
        arms = position - body.pose()[:3]
        close = np.einsum("pc,pc->p", arms, arms) < reach**2
        wide = of_any_corner(close, corners)
        wide[wide] = MIN_DIAMETER * spacings(position, corners.compress(wide, axis=0)) > thickness
        chosen = corners.compress(wide, axis=0)
        return len(chosen) > 0 and bool((body.distance_from(position[np.unique(chosen)]) < thickness).any())


def bond_bits(law: BuiltLaw) -> np.ndarray | None:
    """A copy of the bits of the intact bonds, (words, N); None if bonds cannot break."""
    return None if law.intact is None else law.intact.numpy().copy()


def torn_since(before: np.ndarray | None, law: BuiltLaw) -> np.ndarray | None:
    """Whether a bond of each point has broken since `bond_bits` returned `before`, (N,); None if bonds cannot break."""
    return None if before is None or law.intact is None else (law.intact.numpy() != before).any(axis=0)


def spacings(position: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """The wider spacing of the points of each triangle [m], shape (F,): its longest side may be a diagonal."""
    a, b, c = position.take(corners.T, axis=0)
    first, second, third = (np.einsum("fc,fc->f", side, side) for side in (b - a, c - b, a - c))
    longer = np.maximum(first, second)
    return np.asarray(np.sqrt(np.maximum(np.minimum(first, second), np.minimum(longer, third))))


def of_any_corner(chosen: np.ndarray, corners: np.ndarray) -> np.ndarray:
    """Whether any corner of each triangle is chosen, shape (F,); `corners` are points, shape (F, 3)."""
    first, second, third = chosen.take(corners.T)
    return np.asarray(first | second | third)


def passes(before: np.ndarray, now: np.ndarray, corners: np.ndarray, torn: np.ndarray | None) -> bool:
    """Whether the centre of a body crossed a triangle of the sheet.

    Args:
        before: Positions of all points relative to the centre [m], shape (N, 3).
        now: The same later; the points moved straight.
        corners: Points of the triangles, shape (F, 3).
        torn: Whether a bond of each point has broken, shape (N,), or None; triangles at such points do not count.
    """
    # The centre must lie in the box around the ways of the corners, which leaves few triangles.
    for c in range(3):
        ends = before[:, c], now[:, c]
        below, above = np.minimum(*ends) <= 0.0, np.maximum(*ends) >= 0.0
        met = of_any_corner(below, corners) & of_any_corner(above, corners)
        corners = corners.compress(met, axis=0)
    if torn is not None:
        corners = corners[~of_any_corner(torn, corners)]
    before, now = before[corners], now[corners]
    crossed = np.linalg.det(before) * np.linalg.det(now) < 0.0
    return bool(crossed.any()) and _crosses_inside(before[crossed], now[crossed])


def _crosses_inside(before: np.ndarray, now: np.ndarray) -> bool:
    """Whether the centre crosses the plane of a triangle inside it, for triangles (F, 3, 3) whose planes it crosses."""
    side = np.linalg.det(before)
    low, high = np.zeros(len(side)), np.ones(len(side))
    for _ in range(BISECTIONS):
        part = 0.5 * (low + high)
        met = before + part[:, None, None] * (now - before)
        apart = np.linalg.det(met) * side < 0.0
        low, high = np.where(apart, low, part), np.where(apart, part, high)
    # A point inside a triangle, or on a side, sees all three sides turn one way.
    turns = np.cross(met, np.roll(met, -1, axis=1))
    along = np.einsum("fc,fkc->fk", turns.sum(axis=1), turns)
    return bool((along >= -ON_A_SIDE * np.abs(along).max(axis=1, keepdims=True)).all(axis=1).any())


def sweeps(
    before: np.ndarray,
    now: np.ndarray,
    shape: BodyShape,
    depth: float,
    distances: Callable[[np.ndarray], np.ndarray],
) -> bool:
    """Whether points came from one side of a body to another through it.

    Args:
        before: Positions of points relative to the centre [m], shape (N, 3).
        now: The same later; the points moved straight.
        shape: The body.
        depth: How deep inside it they are on their way, at least [m].
        distances: Signed distances [m], shape (N,), of places, shape (N, 3), relative to the centre.
    """
    thickness, way = shape.thinnest(), now - before
    length = np.linalg.norm(way, axis=1)
    nearest = np.clip(-(before * way).sum(axis=1) / np.maximum(length, 1e-30) ** 2, 0.0, 1.0)
    close = np.linalg.norm(before + nearest[:, None] * way, axis=1) < shape.radius() - depth
    if not close.any():
        return False
    before, way = before[close], way[close]
    places = min(MOST_PLACES, 1 + int(PLACES * length[close].max() / thickness))
    parts = (np.arange(places) + 0.5) / places
    return any(bool((distances(before + part * way) < -depth).any()) for part in parts)
