"""A scene: sheet, force law, parts, solver, and reported numbers. Nothing here uses a device."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, ClassVar

import numpy as np

from ..device.checks import InputError, finite, implements, numbers, show
from ..geometry.regions import Region
from ..geometry.sheet import Sheet
from ..interfaces import Contact, History, Law, Part, Rupture, Solver, Writer
from ..interfaces.frame import OWN_FIELDS


def check_writers(writers: Sequence[Any]) -> None:
    """Check that all `writers` implement Writer. Raises InputError for the first one that does not."""
    for index, writer in enumerate(writers):
        if isinstance(writer, type) or not isinstance(writer, Writer):
            raise InputError(
                f"writers[{index}] = {show(writer)}: expected a Writer with the methods write, save and close"
            )


@dataclass(frozen=True)
class Reported:
    """A number that a scene reports (base class).

    Attributes:
        name: Key in summary.json.
        unit: SI unit.
        value: Its function.
        arguments: What that is given.
        reference: Value to compare with, in the same unit, or None.
        source: Where the reference comes from.
    """

    name: str
    unit: str
    value: Callable[..., float | None]
    reference: float | None = None
    source: str = ""

    arguments: ClassVar[tuple[str, ...]] = ()

    def __post_init__(self) -> None:
        """Check the function, the unit and the reference."""
        what = f"{type(self).__name__} {self.name!r}"
        if not callable(self.value):
            raise InputError(f"{what}: value = {show(self.value)}: expected a function")
        if not _takes(self.value, len(self.arguments)):
            expected = ", ".join(self.arguments)
            raise InputError(f"{what}: value = {show(self.value)}: expected a function of ({expected})")
        if not isinstance(self.unit, str):
            raise InputError(f"{what}: unit = {self.unit!r}: expected text")
        if self.reference is not None:
            finite(f"{what}: reference", self.reference)


def _takes(function: Callable[..., Any], arguments: int) -> bool:
    """Whether a function can be called with so many arguments, as far as its signature tells."""
    try:
        signature = inspect.signature(function)
    except ValueError:
        return True
    try:
        signature.bind(*[None] * arguments)
    except TypeError:
        return False
    return True


class Measure(Reported):
    """A number that a scene reports at every frame; `value` is a function (built simulation, newest frame)."""

    arguments: ClassVar[tuple[str, ...]] = ("built", "frame")


@dataclass(frozen=True)
class Outcome(Reported):
    """A number that a scene reports for the whole run, such as a peak load.

    `value` is a function of the history (one row per frame, in order); None if the number is not known (yet).

    Attributes:
        fine: Whether `value` gets the rows between frames too, if the run has them (`Explicit(history_every=)`), so
            that a peak between frames is not missed. These rows have energies, losses, and forces of bodies and of
            `Reaction`, but no measures.
    """

    fine: bool = False

    arguments: ClassVar[tuple[str, ...]] = ("history",)


@dataclass(eq=False)
class Scene:
    """A sheet and everything that acts on it.

    Attributes:
        sheet: The sheet.
        force: Force law.
        solver: Explicit, Relaxation, Newton or ArcLength.
        loads: Supports and loads.
        contact: A rigid body, a list of them, or None.
        damage: Rupture criterion, or None if bonds cannot break.
        measures: Numbers to report at every frame; the summary has those of the last frame.
        outcomes: Numbers to report for the whole run.
        fields: Names of additional point fields of the frames, out of those that the force law offers.
        chosen_fields: Names of the point fields stored in frame files besides the displacement and `fields`; None for
            all.
        initial_displacement: Displacement [m], shape (N, 3), or None for zero. It is applied instantaneously: the
            stresses of a viscous law are unrelaxed.
        initial_velocity: Velocity [m/s], shape (N, 3), or None for zero.
        track_energy: Whether to sum external work and dissipation for the energy balance.
        scene: Name of the scene.
        file: Python file of a user's scene, or None for a scene of the package.
        section: Section of the paper that the scene reproduces.
        pictures: Function (history, folder) that draws the scene's pictures into the folder; None for the default
            pictures.
        notes: Choices that the scene made for the user, one line each, shown in the summary and on the command line.
        settings: Arguments of the scene's `build`, for the summary and restart files.
        sources: Hashes of the scene's file and of the modules it imports from its folder, by file name.
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

    @property
    def has_fine_history(self) -> bool:
        """Whether a run records rows between frames."""
        return getattr(self.solver, "history_every", None) is not None

    def initial(self, name: str) -> np.ndarray:
        """The initial displacement or velocity, shape (N, 3).

        Raises:
            InputError: if the shape is wrong or a value is not finite.
        """
        values, n = getattr(self, name), self.sheet.size
        if values is None:
            return np.zeros((n, 3))
        found = numbers(name, values)
        if found.shape != (n, 3):
            raise InputError(f"{name}: expected shape ({n}, 3), got {found.shape}")
        return found

    def check(self) -> None:
        """Check the types of the parts and that they fit together."""
        expected: tuple[tuple[str, Any, Any, str], ...] = (
            ("sheet", self.sheet, Sheet, "a Sheet"),
            ("force", self.force, Law, "a force law, such as BondAssociated(material)"),
            ("solver", self.solver, Solver, "Explicit, Relaxation, Newton or ArcLength"),
            ("damage", self.damage, Rupture | None, "TearingEnergy(energy), another criterion or None"),
        )
        if isinstance(self.contact, str) or not isinstance(self.contact, Contact | Sequence | None):
            raise InputError(
                f"contact = {show(self.contact)}: expected a RigidBall, a RigidBody, a SelfContact, a list, or None"
            )
        for name, part, kind, words in expected:
            if not implements(part, kind):
                raise InputError(f"{name} = {show(part)}: expected {words}")
        lists: tuple[tuple[str, Any, Any], ...] = (
            ("loads", self.loads, Part), ("contact", self.contacts, Contact), ("measures", self.measures, Measure),
            ("outcomes", self.outcomes, Outcome),
        )  # fmt: skip
        for name, parts, kind in lists:
            if not isinstance(parts, Sequence) or isinstance(parts, str):
                raise InputError(f"{name} = {show(parts)}: expected a list of {name}")
            for index, part in enumerate(parts):
                if not implements(part, kind):
                    raise InputError(f"{name}[{index}] = {show(part)}: expected an instance of {kind.__name__}")
        if self.pictures is not None and not callable(self.pictures):
            raise InputError(f"pictures = {show(self.pictures)}: expected a function (history, folder) or None")
        for names in (self.fields, self.chosen_fields or ()):
            if isinstance(names, str) or not all(isinstance(name, str) for name in names):
                raise InputError(f"fields = {show(names)}: expected a list of names")
        given = [
            *(("loads", part) for part in self.loads), *(("contact", part) for part in self.contacts),
            ("damage", self.damage),
        ]  # fmt: skip
        for name, part in given:
            if part is not None and part.argument != name:
                raise InputError(f"{name} = {type(part).__name__}: expected it as {part.argument}")
        self._check_regions()
        self._check_names()

    def _check_regions(self) -> None:
        """Check that point sets were selected on this sheet, not for example on the sheet before a hole was cut."""
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
                raise InputError(f"name of a measure = {name!r}: expected one line of text")
            if names.count(name) > 1:
                raise InputError(f"measures: two measures or outcomes have the name {name!r}: expected different names")

    def fields_besides(self, shown: Iterable[str]) -> list[str]:
        """Names of the requested fields that only the force law can compute: neither in every frame nor in `shown`."""
        given = {*OWN_FIELDS, *shown}
        return [name for name in (*self.fields, *(self.chosen_fields or ())) if name not in given]

    @property
    def load_duration(self) -> float | None:
        """Load time at full load of a static solver [s]; None for dynamics."""
        return None if self.solver.dynamic else self.solver.duration
