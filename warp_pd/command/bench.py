"""Benchmark of the time per step: cases, timing, tables.

The sheet is stretched and rough, and the time step is so short that the sheet hardly moves, so every step of a case
does the same work. The benchmark writes no files and records no frames.
"""

from __future__ import annotations

import math
import statistics
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from time import perf_counter
from typing import Any

import numpy as np
import warp as wp

from ..bending.plate import Plate
from ..contact.rigid_body import RigidBall
from ..context import find_device
from ..device.checks import InputError, finite, one_of
from ..interfaces import Law, Part, Rupture
from ..laws.bond_associated import BondAssociated
from ..materials import Gent
from ..papers.bond_based import Bimodular, BondBased
from ..parts.loads import Pressure
from ..parts.rupture import CriticalStretch
from ..parts.supports import Fixed
from ..run.built import Built
from ..run.simulation import Simulation
from ..shapes.sheet import Sheet
from ..solvers.explicit import Explicit
from ..tearing.tearing_energy import TearingEnergy

FEATURES = ("supports", "pressure", "contact", "rupture", "energy", "damping")
# Of what is not among "all": rupture by a damage field in place of "rupture" by a critical stretch, and bending.
DAMAGE_FIELD, BENDING = "damage_field", "bending"
LAYOUTS = ("lattice", "hole", "cloud", "tube")
# Radius of the hole [m] in a square of 1 m.
HOLE = 0.15
# With a step this short the displacement does not change within round-off.
STEP = 1e-12


@dataclass(frozen=True)
class Case:
    """One benchmark case.

    Attributes:
        points: Points along a side of a square sheet, or around and along a tube.
        horizon: Horizon in spacings.
        precision: 32 or 64.
        features: A selection from FEATURES, DAMAGE_FIELD and BENDING.
        layout: One of LAYOUTS; "hole" is a grid with a central hole, "tube" a curved cloud (the square rolled up).
        weights: As for `BondAssociated`.
        damaged: With "rupture", the fraction of points with a broken bond; with DAMAGE_FIELD, the fraction of points
            with damage, around cuts.
        fast: Whether to use the fast kernels.
        law: "bond_associated" (Gent) or "bond_based" (one modulus).
    """

    points: int
    horizon: float
    precision: int = 32
    features: tuple[str, ...] = ()
    layout: str = "lattice"
    weights: str = "plain"
    damaged: float = 0.0
    fast: bool = True
    law: str = "bond_associated"

    def __post_init__(self) -> None:
        for feature in self.features:
            one_of("features", feature, (*FEATURES, DAMAGE_FIELD, BENDING))
        one_of("layout", self.layout, LAYOUTS)
        one_of("law", self.law, ("bond_associated", "bond_based"))
        if not 0.0 <= finite("damaged", self.damaged) <= 1.0:
            raise InputError(f"damaged = {self.damaged!r}: expected a fraction from 0 to 1")
        if {"rupture", DAMAGE_FIELD} <= set(self.features):
            raise InputError(f"features = {self.features!r}: expected 'rupture' or {DAMAGE_FIELD!r}, not both")
        if self.damaged > 0.0 and not {"rupture", DAMAGE_FIELD} & set(self.features):
            raise InputError(f"damaged = {self.damaged!r}: expected 0 without 'rupture' or {DAMAGE_FIELD!r}")

    def simulation(self) -> Simulation:
        """The sheet with its loads, supports and contact."""
        solid: dict[str, Any] = {"thickness": 1e-2, "density": 1000.0}
        if self.layout == "tube":
            around = (self.points, self.points)
            sheet = Sheet.tube(0.5 / np.pi, (self.points - 1) / self.points, points=around, **solid)
        else:
            sheet = Sheet.rectangle(1.0, 1.0, points=self.points, **solid)
        if self.layout == "cloud":
            sheet = sheet.as_cloud()
        if self.layout == "hole":
            sheet = sheet.hole((0.5, 0.5), HOLE)
        for start, end in self.cuts(sheet.spacing):
            sheet = sheet.cut(start, end)
        loads: list[Part] = []
        if "supports" in self.features:
            loads.append(Fixed(sheet.edges("all")))
        if "pressure" in self.features:
            loads.append(Pressure(20.0))
        if BENDING in self.features:
            loads.append(Plate())
        ball = RigidBall(diameter=0.15, start=(0.5, 0.5, 0.5), velocity=(0.0, 0.0, -0.1))
        return Simulation(
            sheet,
            force=self.force(),
            loads=loads,
            contact=ball if "contact" in self.features else None,
            damage=self.rupture(),
            solver=Explicit(duration=1.0, damping=0.1 if "damping" in self.features else 0.0),
            track_energy="energy" in self.features,
            initial_displacement=_rough(sheet),
        )

    def rupture(self) -> Rupture | None:
        """The rupture criterion, if any; the sheet stays far below it, on every grid."""
        if DAMAGE_FIELD in self.features:
            return TearingEnergy(1e5 / (self.points - 1))
        return CriticalStretch(1e3) if "rupture" in self.features else None

    def cuts(self, spacing: float) -> list[tuple[tuple[float, float], tuple[float, float]]]:
        """Cuts across the sheet such that the fraction `damaged` of the points, those around the cuts, has damage."""
        if DAMAGE_FIELD not in self.features or self.damaged == 0.0:
            return []
        # The damage around a cut is four lengths wide, and the length is four spacings by default.
        whole = self.damaged / (16.0 * spacing)
        number = math.ceil(whole / 0.9)
        reach = 0.5 * whole / number
        return [((0.5 - reach, y), (0.5 + reach, y)) for y in (np.arange(number) + 0.5) / number]

    def force(self) -> Law:
        """The force law."""
        if self.law == "bond_based":
            return BondBased(Bimodular(3e3), horizon=self.horizon)
        gent = Gent(mu=1e3, bulk=200e3, lock=160.0)
        return BondAssociated(gent, horizon=self.horizon, weights=self.weights, fast=self.fast)


@dataclass(frozen=True)
class Timing:
    """The measurements of a case.

    Attributes:
        bonds: Number of bonds, each counted from both ends.
        step: Median time of a step [s].
        spread: Half the interquartile range of the measurements, divided by the median.
        array_bytes: Bytes of all arrays.
        setup: Time to build the simulation [s].
        compile: Time to compile or load its kernels [s].
    """

    case: Case
    points: int
    bonds: int
    step: float
    spread: float
    array_bytes: int
    setup: float
    compile: float

    @property
    def point_steps(self) -> float:
        """Points times steps per second."""
        return self.points / self.step

    @property
    def bond_steps(self) -> float:
        """Bonds times steps per second."""
        return self.bonds / self.step


def measure(case: Case, device: Any, seconds: float = 1.0, repeats: int = 9) -> Timing:
    """Time the steps of a case for about `seconds`. Raises InputError for a case that cannot be built."""
    begin = perf_counter()
    built = case.simulation().build(device, case.precision)
    if case.damaged > 0.0 and "rupture" in case.features:
        break_some(built, case.damaged)
    wp.synchronize_device(built.context.device)
    setup = perf_counter() - begin
    compiling = built.context.compile()
    median, spread = time_step(built, seconds, repeats)
    return Timing(
        case=case,
        points=built.simulation.sheet.size,
        bonds=built.law.families.bond_count,
        step=median,
        spread=spread,
        array_bytes=built.context.fields.nbytes,
        setup=setup,
        compile=compiling,
    )


def time_step(built: Built, seconds: float, repeats: int = 9) -> tuple[float, float]:
    """Median time of a step [s] of a sheet that hardly moves, and half the interquartile range over the median."""
    assert built.state.step is not None
    built.state.step.fill_(STEP)
    built.set_clock(STEP, 1.0)
    built.context.run("start")
    built.context.sequence("setup").run()
    times = _clock(built, seconds / repeats, repeats)
    ordered = sorted(times)
    middle = ordered[len(ordered) // 4 : -(len(ordered) // 4) or None]
    median = statistics.median(times)
    return median, 0.5 * (middle[-1] - middle[0]) / median


def _clock(built: Built, seconds: float, repeats: int) -> list[float]:
    """Times of a step [s]."""
    device = built.context.device
    one = built.context.sequence("step")
    one.run()
    wp.synchronize_device(device)
    begin = perf_counter()
    one.run()
    wp.synchronize_device(device)
    once = max(perf_counter() - begin, 1e-7)
    inner = int(min(max(1.0, seconds / once), 100.0))
    many = built.context.sequence("step", repeat=inner)
    many.run()
    wp.synchronize_device(device)
    begin = perf_counter()
    many.run()
    wp.synchronize_device(device)
    loops = max(1, int(seconds / (perf_counter() - begin)))
    times = []
    for _ in range(repeats):
        begin = perf_counter()
        for _ in range(loops):
            many.run()
        wp.synchronize_device(device)
        times.append((perf_counter() - begin) / (loops * inner))
    return times


def break_some(built: Built, fraction: float) -> None:
    """Break single bonds, at both ends, until about this fraction of the points has a broken bond."""
    families, rng = built.law.families, np.random.default_rng(0)
    assert built.law.intact is not None
    intact = built.law.intact.numpy()
    count = built.simulation.sheet.size
    tail = rng.permutation(count)[: max(1, round((1.0 if fraction >= 1.0 else 0.5 * fraction) * count))]
    member = rng.integers(0, families.members, len(tail))
    exists = families.rows_of_points(families.exists)[tail, member]
    tail, member = tail[exists], member[exists]
    heads, reverses = families.heads(tail, member), families.reverse_members(tail, member)
    for points, bits in ((tail, member), (heads, reverses)):
        np.bitwise_and.at(intact, (bits // 32, points), ~(np.uint32(1) << (bits % 32).astype(np.uint32)))
    built.law.intact.assign(intact)


def table(timings: Iterable[Timing]) -> str:
    """The measurements as a markdown table."""
    lines = [
        "| points | law | layout | horizon | float | features | step | spread | point-steps/s | bond-steps/s | "
        "bytes a point | set-up s | compile s |",
        "|---" * 13 + "|",
    ]
    for t in timings:
        c = t.case
        features = ", ".join(c.features) or "none"
        if c.damaged:
            features += f", {100.0 * c.damaged:g} % damaged"
        if not c.fast:
            features += ", reference kernels"
        lines.append(
            f"| {t.points} | {c.law} | {c.layout} | {c.horizon:g} | {c.precision} | {features} | {_time(t.step)} | "
            f"{100.0 * t.spread:.1f} % | {t.point_steps:.3g} | {t.bond_steps:.3g} | {t.array_bytes / t.points:.0f} | "
            f"{t.setup:.2f} | {t.compile:.2f} |"
        )
    return "\n".join(lines)


def _time(seconds: float) -> str:
    return f"{1e6 * seconds:.1f} us" if seconds < 1e-3 else f"{1e3 * seconds:.3f} ms"


def _rough(sheet: Sheet) -> np.ndarray:
    noise = np.random.default_rng(0).uniform(-0.02, 0.02, (sheet.size, 3)) * sheet.spacing
    if sheet.frames is not None:
        return 0.2 * sheet.points + 0.05 * np.sin(7.0 * sheet.points[:, [1, 2, 0]]) + noise
    x, y = sheet.points.T
    return np.column_stack([0.3 * x + 0.05 * np.sin(7.0 * y), -0.1 * y, 0.1 * np.sin(5.0 * x * y)]) + noise


def chosen_features(names: str) -> tuple[str, ...]:
    """Features from a comma-separated list of names; "all" selects all."""
    return FEATURES if names == "all" else tuple(name.strip() for name in names.split(",") if name.strip())


def report(cases: Sequence[Case], device: str | None, seconds: float) -> str:
    """The device and a table of the cost of cases, as text."""
    where = find_device(device)
    return f"{where.name}\n{table([measure(case, str(where), seconds) for case in cases])}"
