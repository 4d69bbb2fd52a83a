"""What contact does not prevent: bodies that pass through each other, and thin ones that pass between points."""

from __future__ import annotations

import itertools
from collections.abc import Sequence

import numpy as np

from ..interfaces import BuiltContact, BuiltLaw, BuiltPart, History
from ..interfaces.context import Context
from .contact import MIN_DIAMETER


def body_checks(context: Context, law: BuiltLaw, contacts: Sequence[BuiltContact]) -> list[BodyChecks]:
    """The checks of a scene with rigid bodies; none in others."""
    bodies = [contact for contact in contacts if contact.outline() is not None]
    return [BodyChecks(context, law, bodies)] if bodies else []


class BodyChecks(BuiltPart):
    """Compares bodies with each other and with the stretched sheet at every frame; what it finds becomes notes.

    Attributes:
        bodies: Those of the scene that have an outline.
    """

    label = "contact"

    def __init__(self, context: Context, law: BuiltLaw, bodies: Sequence[BuiltContact]) -> None:
        self.context, self.law, self.bodies = context, law, bodies
        self._drawn = {body.label: body.outline() for body in self.bodies}
        # What was found, and at which of the frames seen here.
        self._found: dict[tuple[str, ...], tuple[int, str]] = {}
        self._frames = 0
        self._before: tuple[np.ndarray, dict[str, np.ndarray]] | None = None
        self._intact = None if law.intact is None else law.intact.numpy()

    def end_frame(self) -> None:
        """Compare them now."""
        self._frames += 1
        self._compare_bodies()
        # Of a divided sheet, a process has a part alone.
        if self.context.partition is None and len(self.context.sheet.triangles):
            self._compare_with_sheet()

    def notes(self, history: History, load_duration: float | None) -> list[str]:
        """What was found, the first time of each."""
        seen = history[len(history) - self._frames :]
        return [f"{text}, at {seen[frame]['time']:.4g} s" for frame, text in self._found.values()]

    def _note(self, key: tuple[str, ...], text: str) -> None:
        self._found.setdefault(key, (self._frames - 1, text))

    def _compare_bodies(self) -> None:
        for one, other in itertools.combinations(self.bodies, 2):
            depth = max(self._depth(one, other), self._depth(other, one))
            if depth > 0.0:
                self._note(
                    (one.label, other.label),
                    f"{one.label} and {other.label} do not feel each other: they overlap by {depth:.3g} m",
                )

    def _depth(self, one: BuiltContact, other: BuiltContact) -> float:
        """How deep the vertices of a body lie in another one [m]; those of an unbounded body do not count."""
        drawn, pose = self._drawn[one.label], one.pose()
        if drawn is None or pose is None or one.thickness() is None:
            return 0.0
        distance = other.distance_from(drawn.placed(pose))
        return 0.0 if distance is None else -float(distance.min(initial=0.0))

    def _compare_with_sheet(self) -> None:
        sheet = self.context.sheet
        u = np.asarray(self.context.state.displacement.numpy(), np.float64)
        position, corners = sheet.positions + u, sheet.triangles
        centres: dict[str, np.ndarray] = {}
        for body in self.bodies:
            thickness, pose = body.thickness(), body.pose()
            if thickness is None or pose is None:
                continue
            centres[body.label] = pose[:3]
            self._compare_spacing(body, thickness, position, corners)
            if self._before is not None:
                self._look_for_passage(body, position, corners)
        self._before = position, centres

    def _compare_spacing(self, body: BuiltContact, thickness: float, position: np.ndarray, corners: np.ndarray) -> None:
        distance = body.distance_from(position)
        if distance is None:
            return
        near = corners[(distance[corners] < thickness).any(axis=1)]
        if not len(near):
            return
        # The longest side of a triangle may be a diagonal, the second longest is the wider of its two spacings.
        sides = np.sort(np.linalg.norm(position[near] - position[np.roll(near, 1, axis=1)], axis=2), axis=1)
        widest = float(sides[:, 1].max())
        if thickness < MIN_DIAMETER * widest:
            self._note(
                ("thin", body.label),
                f"{body.label} is {thickness:.3g} m thick and may pass between points: those near it are {widest:.3g} "
                f"m apart, expected at most {thickness / MIN_DIAMETER:.3g} m",
            )

    def _look_for_passage(self, body: BuiltContact, position: np.ndarray, corners: np.ndarray) -> None:
        """Whether the centre has passed an intact triangle since the last frame, all moving in straight lines."""
        assert self._before is not None
        before, centres = self._before
        if body.label not in centres:
            return
        pose = body.pose()
        assert pose is not None
        a, b = before[corners] - centres[body.label], position[corners] - pose[:3]
        side, side_now = np.linalg.det(a), np.linalg.det(b)
        crossed = np.flatnonzero(side * side_now < 0.0)
        if self._intact is not None and self.law.intact is not None:
            torn = (self.law.intact.numpy() != self._intact).any(axis=0)
            crossed = crossed[~torn[corners[crossed]].any(axis=1)]
        if not len(crossed):
            return
        part = (side / (side - side_now))[crossed, None, None]
        met = (1.0 - part) * a[crossed] + part * b[crossed]
        # The centre is the origin: inside a triangle it sees all three sides turn one way.
        turns = np.cross(met, np.roll(met, -1, axis=1))
        along = np.einsum("fc,fkc->fk", turns.sum(axis=1), turns)
        if (along > 0.0).all(axis=1).any():
            self._note(
                ("passed", body.label),
                f"{body.label} passed through the sheet without breaking it: expected a thicker body, or more points",
            )
