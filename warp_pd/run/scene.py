"""What a scene is: a sheet, a force law, parts, a solver, and the numbers that it reports. No device is touched."""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError, finite, numbers, said
from ..geometry.regions import Region
from ..geometry.sheet import Sheet
from ..interfaces import Contact, History, Law, Part, Rupture, Solver, Writer
from ..interfaces.frame import OWN_FIELDS, Frame


def check_reference(kind: str, name: str, unit: str, reference: float | None) -> None:
    """Check what a measure or an outcome says of itself.

    Raises:
        InputError: for a unit that is not text, or a reference that is not a number.
    """
    if not isinstance(unit, str):
        raise InputError(f"{kind} {name!r}: unit = {unit!r}: expected text")
    if reference is not None:
        finite(f"{kind} {name!r}: reference", reference)


def check_writers(writers: Sequence[Any]) -> None:
    """Check that all of these write frames.

    Raises:
        InputError: for the first that does not.
    """
    for index, writer in enumerate(writers):
        if isinstance(writer, type) or not isinstance(writer, Writer):
            raise InputError(f"writers[{index}] = {said(writer)}: expected a Writer, which has write, save and close")


@dataclass(frozen=True)
class Measure:
    """A number that a scene reports at every frame.

    Attributes:
        name: Key in summary.json.
        unit: SI unit.
        value: Function of the built simulation and of the newest frame.
        reference: What it is compared with, in the same unit, or None.
        source: Where the reference comes from.
    """

    name: str
    unit: str
    value: Callable[[Any, Frame], float]
    reference: float | None = None
    source: str = ""

    def __post_init__(self) -> None:
        check_reference("Measure", self.name, self.unit, self.reference)


@dataclass(frozen=True)
class Outcome:
    """A number that a scene reports of its whole run, such as a peak load.

    Attributes:
        name: Key in summary.json.
        unit: SI unit.
        value: Function of the history, one row per frame, in order; None as long as the number is not known.
        reference: What it is compared with, in the same unit, or None.
        source: Where the reference comes from.
        fine: Whether it reads the rows between frames, too, where the run has them (`Explicit(history_every=)`): a
            peak between frames is then not lost. They hold energies, losses, forces of bodies and of `Reaction`, and
            no measures.
    """

    name: str
    unit: str
    value: Callable[[History], float | None]
    reference: float | None = None
    source: str = ""
    fine: bool = False

    def __post_init__(self) -> None:
        check_reference("Outcome", self.name, self.unit, self.reference)


@dataclass(eq=False)
class Scene:
    """A sheet and everything that acts on it.

    Attributes:
        sheet: The sheet.
        force: Force law.
        solver: Explicit, Relaxation, Newton or ArcLength.
        loads: Supports and loads.
        contact: A rigid body, a list of them, or None.
        damage: Rupture criterion, or None: nothing can break.
        measures: Numbers to report, at every frame; the summary has those of the last one.
        outcomes: Numbers to report of the whole run.
        fields: Names of further point fields of the frames, of those that the force law offers.
        chosen_fields: Names of all point fields that files of frames hold besides the displacement and `fields`; None:
            all.
        initial_displacement: [m], shape (N, 3), or None for zero. The sheet was brought there at once: nothing of a
            viscous law has relaxed.
        initial_velocity: [m/s], shape (N, 3), or None for zero.
        track_energy: Whether external work and dissipation are summed up for the energy balance.
        scene: Name of the scene.
        file: Python file of a scene that does not come with the package, or None.
        section: Part of the paper that it rebuilds.
        pictures: Function (history, folder) that draws the scene's pictures into the folder of the results; None for
            the default ones.
        notes: What a scene decided for the user, one line each; the summary and the command line repeat them.
        settings: Arguments of the scene's `build`, for the summary and restart files.
        sources: Hashes of the code of the scene's file and of the modules beside it that it uses, by file name.
    """

    sheet: Sheet
    force: Law
    solver: Solver
    loads: Sequence[Part] = ()
    contact: Contact | Sequence[Contact] | None = None
    damage: Rupture | None = None
    measures: Sequence[Measure] = ()
    outcomes: Sequence[Outcome] = ()
    fields: Sequence[str] = ()
    chosen_fields: Sequence[str] | None = None
    initial_displacement: np.ndarray | None = None
    initial_velocity: np.ndarray | None = None
    track_energy: bool = True
    scene: str = "simulation"
    file: str | None = None
    section: str = ""
    pictures: Callable[[History, Path], None] | None = None
    notes: Sequence[str] = ()
    settings: dict[str, Any] = field(default_factory=dict)
    sources: dict[str, str] = field(default_factory=dict)

    @property
    def contacts(self) -> tuple[Contact, ...]:
        """All contacts."""
        if self.contact is None:
            return ()
        return tuple(self.contact) if isinstance(self.contact, Sequence) else (self.contact,)

    def initial(self, name: str) -> np.ndarray:
        """The initial displacement or velocity, shape (N, 3).

        Raises:
            InputError: for another shape, or numbers that are not finite.
        """
        values, n = getattr(self, name), self.sheet.size
        if values is None:
            return np.zeros((n, 3))
        found = numbers(name, values)
        if found.shape != (n, 3):
            raise InputError(f"{name} has shape {found.shape}: expected ({n}, 3)")
        return found

    def check(self) -> None:
        """Compare the parts with what is expected of them, and with each other.

        Raises:
            InputError: for a part of the wrong kind, or two measures of one name.
        """
        expected: tuple[tuple[str, Any, Any, str], ...] = (
            ("sheet", self.sheet, Sheet, "a Sheet"),
            ("force", self.force, Law, "a force law, such as BondAssociated(material)"),
            ("solver", self.solver, Solver, "Explicit, Relaxation, Newton or ArcLength"),
            ("damage", self.damage, Rupture | None, "CriticalStretch, CriticalEnergy or None"),
        )
        if isinstance(self.contact, str) or not isinstance(self.contact, Contact | Sequence | None):
            raise InputError(
                f"contact = {said(self.contact)}: expected a RigidBall, a RigidBody, a SelfContact, a list, or None"
            )
        for name, part, kind, words in expected:
            if isinstance(part, type) or not isinstance(part, kind):
                raise InputError(f"{name} = {said(part)}: expected {words}")
        lists: tuple[tuple[str, Any, Any], ...] = (
            ("loads", self.loads, Part), ("contact", self.contacts, Contact), ("measures", self.measures, Measure),
            ("outcomes", self.outcomes, Outcome),
        )  # fmt: skip
        for name, parts, kind in lists:
            if not isinstance(parts, Sequence) or isinstance(parts, str):
                raise InputError(f"{name} = {said(parts)}: expected a list of {name}")
            for index, part in enumerate(parts):
                if isinstance(part, type) or not isinstance(part, kind):
                    raise InputError(f"{name}[{index}] = {said(part)}: expected an instance of {kind.__name__}")
        for names in (self.fields, self.chosen_fields or ()):
            if isinstance(names, str) or not all(isinstance(name, str) for name in names):
                raise InputError(f"fields = {said(names)}: expected a list of names")
        given = [
            *(("loads", part) for part in self.loads), *(("contact", part) for part in self.contacts),
            ("damage", self.damage),
        ]  # fmt: skip
        for name, part in given:
            if part is not None and part.argument != name:
                raise InputError(f"{name}: {type(part).__name__} is given here, expected as {part.argument}")
        self._check_regions()
        self._check_names()

    def _check_regions(self) -> None:
        """Refuse points that were taken from another sheet, such as this one before a hole was cut into it."""
        for part in [*self.loads, *self.contacts, *([self.damage] if self.damage is not None else [])]:
            for name, value in getattr(part, "__dict__", {}).items():
                if isinstance(value, Region) and not value.fits(self.sheet.points):
                    raise InputError(
                        f"{type(part).__name__}.{name}: expected points of this sheet; they were taken from another, "
                        "such as this one before a hole; take them again from the sheet that is simulated"
                    )

    def _check_names(self) -> None:
        names = [m.name for m in self.measures] + [o.name for o in self.outcomes]
        for name in names:
            if not isinstance(name, str) or not name or not name.isprintable():
                raise InputError(f"name of a measure = {name!r}: expected text in one line")
            if names.count(name) > 1:
                raise InputError(f"measures: two measures or outcomes have the name {name!r}: expected different names")

    def fields_besides(self, shown: Iterable[str]) -> list[str]:
        """Names of the requested fields that only the force law can give: neither in every frame nor in `shown`."""
        given = {*OWN_FIELDS, *shown}
        return [name for name in (*self.fields, *(self.chosen_fields or ())) if name not in given]

    @property
    def load_duration(self) -> float | None:
        """Load time of the whole load of a static solver [s]; None for dynamics."""
        return None if self.solver.dynamic else self.solver.duration
