"""Uniform tests at constant rates, without a simulation: constants of materials, Prony terms and Maxwell elements."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import singledispatch
from itertools import zip_longest
from typing import Any, cast

import numpy as np

from ..device.checks import InputError, not_negative
from ..laws.bond_associated import BondAssociated
from ..materials import stability_notes
from ..papers.analytic_response import prony_stress
from ..visco.law import Maxwell, Prony, Visco
from ..visco.uniform import maxwell_stress
from .data import Curve, Table, require_stretches
from .experiment import Model
from .uniform import LOADINGS, UniformModel, UniformTests, nominal_stress

# Steps of a ramp in which the relaxing stresses are summed up.
STEPS = 800
# A measured ramp may go back by this part of its range: noise.
BACK = 0.05
# Loading, and the value of the undeformed sheet, by the name of a column.
STRETCHES = {
    f"{loading}{kind}": (loading, undeformed)
    for loading in LOADINGS
    for kind, undeformed in (("", 1.0), ("_stretch", 1.0), ("_strain", 0.0))
}
# Units of a stretch: those with a name are mostly of strains.
PURE = ("1", "-")
# Change of a constant that shows which terms it belongs to.
NUDGE = 1e-3


@singledispatch
def relaxing_terms(law: Any) -> tuple[Sequence[Prony], Sequence[Maxwell]]:
    """Prony terms and Maxwell elements of a law.

    Raises:
        InputError: for a law whose uniform stress is not that of its material.
    """
    raise InputError(f"force = {type(law).__name__}: expected BondAssociated or Visco with curves of uniform tests")


@relaxing_terms.register
def _(law: BondAssociated) -> tuple[Sequence[Prony], Sequence[Maxwell]]:
    """None."""
    return (), ()


@relaxing_terms.register
def _(law: Visco) -> tuple[Sequence[Prony], Sequence[Maxwell]]:
    """Those that it has."""
    return law.prony, law.branches


def rate_stress(law: BondAssociated, loading: str, rate: float, stretch: np.ndarray) -> np.ndarray:
    """First Piola stress along the pull of a sheet that is stretched at a constant rate [Pa], shape of `stretch`.

    Args:
        law: Material, with Prony terms or Maxwell elements or without; the width of a uniaxial sheet with them is that
            of an incompressible one.
        loading: "uniaxial", "equibiaxial" or "planar".
        rate: |d stretch / dt| [1/s]; 0 is a test in which everything has relaxed.
        stretch: Stretches above 1 or below 1 [-], shape (n,).

    Raises:
        InputError: for stretches on both sides of 1, or another loading.
    """
    total = nominal_stress(law.material, loading, stretch)
    prony, branches = relaxing_terms(law)
    if rate == 0.0 or not (prony or branches):
        return total
    if np.min(stretch) < 1.0 < np.max(stretch):
        raise InputError(
            f"stretch: expected all above 1 or all below 1 in a ramp, got {min(stretch):g}, {max(stretch):g}"
        )
    far = stretch[np.argmax(np.abs(stretch - 1.0))]
    # Times must rise: a ramp to 1 has a length.
    path = np.unique(np.abs(np.concatenate([np.linspace(0.0, max(abs(far - 1.0), 1e-9), STEPS), stretch - 1.0])))
    x = 1.0 + np.sign(far - 1.0) * path
    y = {"uniaxial": x**-0.5, "equibiaxial": x, "planar": np.ones_like(x)}[loading]
    relaxing = prony_stress(prony, path / rate, x, y)
    for branch in branches:
        relaxing = relaxing + maxwell_stress(branch, path / rate, x, y)
    return np.asarray(total + np.interp(np.abs(stretch - 1.0), path, relaxing))


@dataclass(frozen=True, eq=False)
class RateTests(UniformTests):
    """Uniform tests of one rubber at several rates.

    `material` is a function from constants to a law, `Visco` or `BondAssociated`: its material and what relaxes.

    Attributes:
        rates: |d stretch / dt| of each test [1/s]; 0 for one in which everything has relaxed.
    """

    rates: Sequence[float] = field(default=())

    def __post_init__(self) -> None:
        if len(self.rates) != len(self.tests):
            raise InputError(f"rates: expected one for each of {len(self.tests)} tests, got {len(self.rates)}")
        for rate in self.rates:
            not_negative("rates", rate)

    def notes(self, constants: Mapping[str, float]) -> list[str]:
        """Where the material loses its stability, wrong signs, and what these rates cannot tell of the terms."""
        material = self.made_of(constants).material
        return [*stability_notes(material), *self.wrong_signs(), *self._untold(constants)]

    def _untold(self, constants: Mapping[str, float]) -> list[str]:
        """Notes on relaxing terms without enough rates."""
        rates = {rate for rate in self.rates if rate > 0.0}
        prony, branches = relaxing_terms(self.made_of(constants))
        if not (prony or branches):
            return ["rates: nothing in the law relaxes, so they change nothing"] if rates else []
        varied = self._varied(constants, [*prony, *branches])
        if not rates:
            said = "rates: expected some above 0, as everything has relaxed at 0 and nothing tells what relaxes"
            return [said] if varied else []
        notes, times = [], sum(what == "time" for what, _ in varied)
        if len(rates) < times:
            notes.append(
                f"rates: {len(rates)} above 0 for {times} relaxation times that vary: the shape of curves alone tells "
                "them apart; expected as many rates as times"
            )
        if len(rates) < 2 and any(what == "exponent" for what, _ in varied):
            notes.append("rates: one above 0, which cannot tell how a relaxation time depends on it; expected two")
        return notes

    def _varied(self, constants: Mapping[str, float], terms: Sequence[Prony | Maxwell]) -> set[tuple[str, int]]:
        """What the constants change: "time", "exponent" or "stress" of the terms, by their number."""
        varied = set()
        for name, value in constants.items():
            prony, branches = relaxing_terms(self.made_of({**constants, name: value * (1.0 + NUDGE) or NUDGE}))
            moved: list[Prony | Maxwell] = [*prony, *branches]
            # A term of no stress is left out, so there may be more of them now.
            for n, (other, term) in enumerate(zip_longest(moved, terms)):
                if other is None or term is None or other.constants[:2] != term.constants[:2]:
                    varied.add(("stress", n))
                if other is not None and term is not None and other.time != term.time:
                    varied.add(("time", n))
                if other is not None and term is not None and other.constants[3] != term.constants[3]:
                    varied.add(("exponent", n))
        return varied

    def model(self, vary: Sequence[str], start: np.ndarray, device: str | None, precision: int | None) -> Model:
        """The exact stress along the ramps."""
        plain = cast(UniformModel, super().model(vary, start, device, precision))
        return RateModel(plain.material, plain.tests, plain.vary, plain.settings, plain.sizes, tuple(self.rates))


@dataclass(eq=False)
class RateModel(UniformModel):
    """Model of tests at constant rates; `sizes` as for `Model`."""

    rates: tuple[float, ...] = ()

    def evaluate(self, values: np.ndarray) -> list[np.ndarray]:
        """The stress of every test [Pa]."""
        made_by = cast(Callable[..., BondAssociated], self.material)
        law = made_by(**{**self.settings, **dict(zip(self.vary, values.tolist(), strict=True))})
        return [
            rate_stress(law, test.control, rate, test.at) for test, rate in zip(self.tests, self.rates, strict=True)
        ]


def law_tests(build: Callable[..., Any], ramps: Sequence[tuple[Curve, float]], given: Mapping[str, Any]) -> RateTests:
    """Tests of the law of a scene, which is built for its law alone.

    Args:
        build: Function that builds the scene.
        ramps: Curves and their rates [1/s], see `read_ramps`.
        given: Arguments of `build`.
    """
    signature = inspect.signature(build)

    def law(**values: Any) -> BondAssociated:
        force = build(**values).force
        relaxing_terms(force)
        return cast(BondAssociated, force)

    law.__signature__ = signature  # type: ignore[attr-defined]
    numbers = {
        name: parameter.default
        for name, parameter in signature.parameters.items()
        if isinstance(parameter.default, int | float) and not isinstance(parameter.default, bool)
    }
    return RateTests(law, [curve for curve, _ in ramps], {**numbers, **given}, rates=[rate for _, rate in ramps])


def read_ramps(table: Table, measure: str | None) -> tuple[list[tuple[Curve, float]], list[str]] | None:
    """Read the curves of uniform tests in a file, with their rates [1/s], and notes; None for any other file.

    A column "uniaxial", "equibiaxial" or "planar", alone or followed by "stretch", has the stretch; one followed by
    "strain" the stretch less 1. Another column has the nominal stress; one whose name begins with "true" has the true
    stress of an incompressible sheet. A column "rate" has |d stretch / dt|; each of its values makes a curve.

    Raises:
        InputError: if columns are missing, or have other units, or the stretches of a rate are no ramp from 1.
    """
    file = table.path.name
    found = [(name, *kind) for name in table.columns if (kind := STRETCHES.get(name)) is not None]
    if not found:
        return None
    if len(found) > 1:
        raise InputError(f"{file}: columns {', '.join(name for name, *_ in found)}: expected one of them")
    (column, loading, undeformed), rated = found[0], "rate" in table.columns
    stress = _stress_column(table, column, measure)
    for name, wanted in ((column, "ratio"), (stress, "pressure"), *([("rate", "rate")] if rated else [])):
        if table.dimensions[name] != wanted:
            raise InputError(f"{file}: column {name!r} is a {table.dimensions[name]}: expected a {wanted}")
    if column == loading and table.units[column] not in PURE:
        raise InputError(
            f"{file}: column {column!r} in [{table.units[column]}] may be strains or stretches: expected "
            f"'{loading} strain' or '{loading} stretch'"
        )
    columns, rows = table.without_gaps([column, stress, *(["rate"] if rated else [])])
    if len(rows) == 0:
        raise InputError(f"{file}: expected rows with both {column} and {stress}")
    stretch = columns[column] + (1.0 - undeformed)
    require_stretches(f"{file}: column {column!r}", stretch)
    values = columns[stress] / (stretch if stress.startswith("true") else 1.0)
    rates = columns["rate"] if rated else np.zeros(len(rows))
    ramps = []
    for rate in np.unique(rates):
        mine = rates == rate
        name = f"{table.path.stem}, {rate:g} /s" if rated else table.path.stem
        not_negative(f"{file}: rate", float(rate))
        if rate > 0.0:
            _require_ramp(f"{file}: column {column!r} at {rate:g} /s", stretch[mine])
        curve = Curve(loading, stretch[mine], "stress", values[mine], name=name, rows=rows[mine], units=("1", "Pa"))
        ramps.append((curve, float(rate)))
    notes = [] if rated else [f"{file}: no column rate [1/s]: taken as a test in which everything has relaxed"]
    return ramps, [*table.notes, *notes]


def _stress_column(table: Table, column: str, measure: str | None) -> str:
    others = [name for name in table.columns if name not in (column, "rate")]
    if measure is not None and measure in others:
        return measure
    stresses = [name for name in others if table.dimensions[name] == "pressure"]
    if len(stresses) != 1:
        raise InputError(
            f"{table.path.name}: columns {', '.join(table.columns)}: expected one of stress beside {column!r}, such "
            "as 'stress [MPa]', or its name as measure (--measure)"
        )
    return stresses[0]


def _require_ramp(name: str, stretch: np.ndarray) -> None:
    """Check that stretches in their order are a ramp from 1. Raises InputError otherwise."""
    if stretch.min() < 1.0 < stretch.max():
        raise InputError(
            f"{name}: {stretch.min():g} to {stretch.max():g}: expected all above 1 or all below 1 in a ramp"
        )
    far = np.abs(stretch - 1.0)
    back = float((np.maximum.accumulate(far) - far).max())
    if back > BACK * far.max():
        raise InputError(
            f"{name}: goes back by {back:g}: expected rows of one ramp away from 1 in their order, without unloading"
        )
