"""Does it stay stable on stiff and extreme cases? A verdict and a number for every case and force law.

    python tools/stability.py --out docs/stability.md               # all cases; the longest runs stop after --seconds
    python tools/stability.py --fast                                # short versions and one law, for CI
    python tools/stability.py --device cuda:0 --jobs 16 --seconds 20 --stand HASH --out docs/stability-gpu.md
    python tools/stability.py --only "units" "ball"                 # cases whose name holds one of these
    python tools/stability.py --laws visco --out docs/stability.md  # adds to the page, or replaces, what it runs

Every case runs in float32 and in float64. The numbers are in the JSON beside the page, saved as they come: a call that
was stopped goes on with --missing. A page is of one device. Verdicts:

    stable                     at the default share of the estimated step, 0.9
    stable with a smaller step the share that holds is the number's remark
    diverges cleanly           the run ends with a message, input is refused with one, and nothing written is not finite
    wrong                      finite, but it breaks physics: energy, objectivity, a value
    does not apply             the law has no such thing; the remark says why
"""

from __future__ import annotations

import argparse
import json
import math
import multiprocessing
import os
import re
import tempfile
import threading
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from dataclasses import asdict, dataclass, replace
from pathlib import Path
from time import perf_counter
from typing import Any

import numpy as np
from scipy.optimize import bisect, brentq
from stamp import device_name, one_line, stamp

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    BondNeoHookean,
    CriticalStretch,
    Explicit,
    Fixed,
    Frame,
    Gent,
    HyperelasticBonds,
    InputError,
    NeoHookean,
    Neural,
    Nodal,
    Prony,
    RigidBall,
    Sheet,
    Simulation,
    Visco,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.bonds import pack
from warp_pd.forces import ForceLaw
from warp_pd.launches import run_once
from warp_pd.runner import DIVERGED, MOST_GAIN, DivergedError, write_aside
from warp_pd.simulation import Built, find_device
from warp_pd.solvers.explicit import FIRST_ITERATIONS

STABLE, SMALLER, CLEAN, WRONG, NONE = (
    "stable", "stable with a smaller step", "diverges cleanly", "wrong", "does not apply",
)  # fmt: skip
# Shares of the estimated step that are tried in turn.
SHARES = (0.9, 0.45, 0.2, 0.1, 0.05, 0.02)
MU, DENSITY, THICKNESS, HORIZON = 1e3, 1e3, 0.01, 2.015
# K/mu of the sheets near their lock: softer ones swell instead.
NEARLY = 1e4
# Error of the energy balance, or energy beyond what was put in, above which a run is wrong.
ENERGY_ERROR = 0.02
# Fall of the viscous loss from frame to frame over the largest energy, above which a run is wrong.
LOSS_ERROR = 1e-4
KINETIC, GAIN = "k = ", "gain "
# Seconds after the first share of the step, with which kernels are compiled, after which no further one is tried.
PATIENCE = 10.0


class NotThere(Exception):
    """The law has no such thing; the message says why."""


@dataclass(frozen=True)
class Rubber:
    """What the laws' materials are made of: shear modulus [Pa], K/mu, Jm of a Gent sheet or None, relaxation time [s].

    A shear wave crosses most sheets in a second.
    """

    mu: float = MU
    ratio: float = 100.0
    lock: float | None = None
    relaxation: float = 0.1

    @property
    def material(self) -> NeoHookean | Gent:
        """Neo-Hookean, or Gent where there is a lock."""
        bulk = self.ratio * self.mu
        return NeoHookean(self.mu, bulk) if self.lock is None else Gent(self.mu, bulk, self.lock)

    @property
    def prony(self) -> tuple[Prony, ...]:
        """Terms that relax, over a constant time and over one that falls with the rate."""
        return (
            Prony(0.125 * self.mu, time=self.relaxation),
            Prony(0.05 * self.mu, time=10.0 * self.relaxation, exponent=1.6665),
        )

    def mu_alone(self, volume: str) -> float:
        """The shear modulus, for laws of bonds, which know nothing else; what there is of the volume is for people."""
        if self.lock is not None:
            raise NotThere("the law has no lock")
        if self.ratio != Rubber.ratio:
            raise NotThere(f"the law has no K/mu: {volume}")
        return self.mu

    def thickness_stretch(self, a: float, b: float) -> float:
        """C33 of the principal stretches a and b, apart from the kernels: zero of sigma_33. NaN beyond the lock."""
        trace, det, bulk = a * a + b * b, (a * b) ** 2, self.ratio * self.mu

        def pull(c33: Any) -> Any:
            volume = c33 * det
            pressure = 0.5 * bulk * (volume - 1.0) if self.lock else 0.25 * bulk * (volume - 1.0 / volume)
            return self._shear(trace, c33, volume) * (2.0 * c33 - trace) / 3.0 + pressure

        # The root lies on the near side of the pole that the Gent material has at its lock.
        grid = np.geomspace(1e-2, 1e8, 40001) / det
        values, good = pull(grid), self._shear(trace, grid, grid * det) > 0.0
        at = np.flatnonzero((values[:-1] < 0.0) & (values[1:] >= 0.0) & good[:-1] & good[1:])
        if len(at) == 0:
            return math.nan
        return float(brentq(pull, grid[at[0]], grid[at[0] + 1], xtol=1e-15, rtol=8.9e-16))

    def _shear(self, trace: float, c33: Any, volume: Any) -> Any:
        modified = volume ** (-1.0 / 3.0)
        if self.lock is None:
            return self.mu * modified
        return self.mu * self.lock * modified / (self.lock - modified * (trace + c33) + 3.0)

    def stress(self, a: float, b: float) -> np.ndarray:
        """Principal first Piola stresses [Pa]."""
        c33 = self.thickness_stretch(a, b)
        g = self._shear(a * a + b * b, c33, c33 * (a * b) ** 2)
        return g * np.array([a - c33 / a, b - c33 / b])

    def share_of_lock(self, a: float) -> float:
        """(I1b - 3) / Jm under equibiaxial stretch; 1 beyond the lock."""
        assert self.lock is not None
        c33 = self.thickness_stretch(a, a)
        if math.isnan(c33):
            return 1.0
        return ((c33 * a**4) ** (-1.0 / 3.0) * (2.0 * a * a + c33) - 3.0) / self.lock

    def energy(self, a: float, b: float) -> float:
        """Stored energy [J/m^3] under the principal stretches a and b, by the way that stretches both together."""
        share, weight = np.polynomial.legendre.leggauss(24)
        share, weight = 0.5 * (share + 1.0), 0.5 * weight
        way = np.array([a - 1.0, b - 1.0])
        return float(sum(w * self.stress(*(1.0 + s * way)) @ way for s, w in zip(share, weight, strict=True)))


RUBBER = Rubber()
# One line a law: what makes it of a rubber.
LAWS: dict[str, Callable[[Rubber], ForceLaw]] = {
    "nodal": lambda r: Nodal(r.material),
    "published": lambda r: BondAssociated(r.material, horizon=HORIZON, weights="published"),
    "plain": lambda r: BondAssociated(r.material, horizon=HORIZON, weights="plain"),
    "corrected": lambda r: BondAssociated(r.material, horizon=HORIZON, weights="corrected"),
    "closed form": lambda r: Neural(r.material, evaluation="closed_form"),
    "neural": lambda r: Neural(r.material, evaluation="fused"),
    "bond-based": lambda r: BondBased(Bimodular(3.0 * r.mu_alone("nu is 1/3"))),
    "hyperelastic bonds": lambda r: HyperelasticBonds(BondNeoHookean(r.mu_alone("it is incompressible"))),
    "visco": lambda r: Visco(r.material, prony=r.prony, horizon=HORIZON, weights="corrected"),
    "visco bonds": lambda r: ViscoBondBased(Yeoh(0.5 * r.mu_alone("its energy knows no volume")), prony=r.prony),
    "visco series": lambda r: replace(LAWS["visco bonds"](r), update="series"),
}


@dataclass(frozen=True, eq=False)
class Finding:
    """What a case found of a law, in one precision.

    Attributes:
        verdict: One of the five.
        number: The number behind it, or None.
        remark: What else there is to say.
        field: What float32 and float64 are compared by, or None: the number.
        unit: What the number is where it is not the column's: KINETIC, for laws without an energy, or GAIN.
    """

    verdict: str
    number: float | None = None
    remark: str = ""
    field: np.ndarray | None = None
    unit: str = ""


@dataclass(frozen=True)
class Trial:
    """Where a case runs: law, precision, device; and how long the long ones may.

    Attributes:
        law: Name of the law.
        bits: 32 or 64.
        device: Name of the device, or None.
        steps: Of the oscillation; the spin takes a tenth.
        seconds: After which those two stop.
        short: Whether fewer steps will do.
    """

    law: str
    bits: int
    device: str | None
    steps: int = 1_000_000
    seconds: float = 20.0
    short: bool = False

    def simulation(self, sheet: Sheet, rubber: Rubber = RUBBER, **parts: Any) -> Simulation:
        """A simulation of the sheet with the law."""
        parts.setdefault("solver", Explicit(1.0))
        try:
            return Simulation(sheet, LAWS[self.law](rubber), **parts)
        except InputError as error:
            raise NotThere(str(error)) from None

    def built(self, sheet: Sheet, rubber: Rubber = RUBBER, **parts: Any) -> Built:
        """The same on the device, compiled."""
        built = self.simulation(sheet, rubber, **parts).build(self.device, self.bits)
        built.workspace.compile()
        return built


@dataclass(frozen=True)
class Case:
    """One row of the table.

    Attributes:
        name: For people, and for --only.
        number: What the number is.
        find: The case.
        fast: Whether it belongs to --fast.
    """

    name: str
    number: str
    find: Callable[[Trial], Finding]
    fast: bool = False


def nice(number: float) -> str:
    """A number for people."""
    return (
        f"{number:{'.3g' if number < 1e4 else '.2e'}}".replace(".00e", "e")
        .replace("0e", "e")
        .replace("e-0", "e-")
        .replace("e+0", "e")
        .replace("e+", "e")
    )


# Pieces of the cases ---------------------------------------------------------------------------------------


def square(points: int = 9, size: float = 1.0, thickness: float = THICKNESS, density: float = DENSITY) -> Sheet:
    """A square sheet on a lattice."""
    return Sheet.rectangle(size, size, thickness=thickness, density=density, points=points)


def stretched(sheet: Sheet, a: float, b: float) -> np.ndarray:
    """Displacement of a uniform stretch about the middle, shape (N, 3)."""
    middle = sheet.points - sheet.points.mean(axis=0)
    return np.column_stack([(a - 1.0) * middle[:, 0], (b - 1.0) * middle[:, 1], np.zeros(sheet.size)])


def smooth(sheet: Sheet, amount: float) -> np.ndarray:
    """A smooth displacement in and out of the plane, zero at the edges, `amount` of the side; shape (N, 3)."""
    low = sheet.points.min(axis=0)
    side = np.ptp(sheet.points, axis=0)
    x, y = ((sheet.points - low) / side).T
    bump = amount * side[0] * np.sin(np.pi * x) * np.sin(np.pi * y)
    return np.column_stack([0.5 * bump * np.sin(2.0 * np.pi * y), -0.3 * bump * x, bump])


def rough(sheet: Sheet, amount: float, seed: int = 0) -> np.ndarray:
    """Random displacements of up to `amount` spacings, zero at the edges; shape (N, 3)."""
    noise = np.random.default_rng(seed).uniform(-amount, amount, (sheet.size, 3)) * sheet.spacing
    noise[sheet.edges("all")] = 0.0
    return noise


def force_at(built: Built, displacement: np.ndarray) -> np.ndarray:
    """Internal force [N] at a displacement [m], both of shape (N, 3)."""
    built.state.displacement.assign(displacement.astype(built.state.displacement.numpy().dtype))
    run_once(built.workspace.device, built.workspace.stages["setup"])
    return built.to_numpy(built.state.force)


def energies(built: Built) -> tuple[float, float]:
    """Kinetic energy, and stored energy with viscous loss [J]; the latter is NaN for a law without an energy."""
    run_once(built.workspace.device, built.workspace.stages["frame"])
    strain = built.strain_energy
    stored = math.nan if strain is None else float(strain.numpy().sum()) + lost(built)
    return float(built.kinetic_energy.numpy().sum()), stored


def lost(built: Built) -> float:
    """What viscosity took so far [J], as of the last frame; 0 for a law that does not say."""
    viscous = getattr(built.force, "viscous", None)
    return 0.0 if viscous is None else float(viscous.numpy().sum())


def settle(built: Built, displacement: np.ndarray) -> None:
    """Bring a displacement [m], shape (N, 3), and the internal variables to what a long rest there leaves."""
    start = displacement.astype(built.state.displacement.numpy().dtype)
    if built.force.internal:
        built.state.displacement.assign(start)
        built.state.velocity.zero_()
        # A step of no length brings the strain; all else has relaxed.
        drive(built, 1e-9, 1)
        for name, array in built.force.internal.items():
            if name != "strain":
                array.zero_()
    built.state.displacement.assign(start)


def tension_at_rest(simulation: Simulation, budget: float, standing: float = 1.0) -> float:
    """An energy [J] with what the law ViscoBondBased, under tension at rest, gives when it pulls its bonds to nothing.

    `budget` is of the long-term shear modulus; forces are of the instantaneous one. `standing` is the share of bonds.
    """
    law = simulation.force
    if not isinstance(law, ViscoBondBased):
        return budget
    more = 1.0 + sum(term.c10 for term in law.prony) / law.material.c10
    return more * (budget + standing * 3.0 * law.material.c10 * volume(simulation.sheet))


def stable_step(built: Built) -> float:
    """The product's estimate [s], as a run makes it."""
    return Explicit(1.0).estimate(built, FIRST_ITERATIONS)


def drive(built: Built, dt: float, steps: int) -> None:
    """Take steps of `dt` from the state as it is."""
    run_once(built.workspace.device, built.workspace.stages["setup"])
    built.step.fill_(dt)
    many = built.workspace.sequence("step", repeat=max(1, min(100, steps)))
    for _ in range(max(1, steps // 100)):
        many.run()


def finite(built: Built) -> bool:
    """Whether displacements and velocities are finite."""
    state = built.state
    return bool(np.isfinite(state.displacement.numpy()).all() and np.isfinite(state.velocity.numpy()).all())


class FiniteFrames:
    """Writer that remembers whether it was ever handed a number that is not finite."""

    def __init__(self) -> None:
        self.all_finite = True

    def write(self, frame: Frame) -> None:
        """Look at the frame."""
        self.all_finite &= bool(np.isfinite(frame.displacement).all() and np.isfinite(frame.velocity).all())

    def save(self) -> None:
        """Nothing to save."""

    def close(self) -> None:
        """Nothing to close."""


def run_once_at(trial: Trial, simulation: Simulation, budget: float) -> Finding:
    """Verdict of one whole run of the product.

    The number is the worst error of the energy balance over the largest energy; for a law without an energy of its
    own, the largest kinetic energy over `budget` [J], the energy that there can be.
    """
    watch, budget = FiniteFrames(), tension_at_rest(simulation, budget)
    try:
        result = simulation.run(device=trial.device, precision=trial.bits, writers=[watch])
    except DivergedError as error:
        return Finding(CLEAN, None, str(error))
    rows = result.history
    if "balance_error" in rows[-1]:
        number, most, unit = max(abs(row["balance_error"]) for row in rows), ENERGY_ERROR, ""
    else:
        number, most, unit = max(row["kinetic"] for row in rows) / budget, 1.0 + ENERGY_ERROR, KINETIC
    if not watch.all_finite:
        return Finding(WRONG, number, "a frame that is not finite was written", unit=unit)
    if result.status == DIVERGED:
        return Finding(CLEAN, number, result.summary["message"], unit=unit)
    if number > most:
        return Finding(WRONG, number, "energy", unit=unit)
    lost = np.array([row.get("viscous", 0.0) for row in rows])
    fall = -np.diff(lost).min() / max(row["kinetic"] + row.get("strain", 0.0) for row in rows)
    # Where a bond breaks, the strain of the others jumps, and what they store.
    if simulation.damage is None and fall > LOSS_ERROR:
        return Finding(WRONG, fall, "the viscous loss falls", unit=unit)
    return Finding(STABLE, number, field=result.frame.displacement, unit=unit)


def attempt(trial: Trial, make: Callable[[float], Simulation], budget: float) -> Finding:
    """The largest share of the step at which the run holds; failing that, what became of it at the smallest."""
    found, begin = Finding(NONE), math.inf
    for share in SHARES:
        found = run_once_at(trial, make(share), budget)
        if found.verdict == STABLE:
            return found if share == SHARES[0] else replace(found, verdict=SMALLER, remark=f"at {share:g}")
        found = replace(found, remark=f"at {share:g}: {found.remark}")
        begin = min(begin, perf_counter())
        if perf_counter() - begin > PATIENCE:
            break
    return found


def duration(trial: Trial, sheet: Sheet, rubber: Rubber, crossings: float) -> float:
    """Time in which a shear wave crosses the sheet so many times [s]."""
    side = float(np.ptp(sheet.points, axis=0).max())
    return (0.25 if trial.short else 1.0) * crossings * side / math.sqrt(rubber.mu / sheet.density)


def volume(sheet: Sheet) -> float:
    """Volume of the sheet [m^3]."""
    return float(sheet.areas.sum() * sheet.thickness)


def stress_error(built: Built, sheet: Sheet, rubber: Rubber, a: float, b: float) -> tuple[float, np.ndarray]:
    """Error of the mean stress of a uniformly stretched sheet over the exact one, and that stress [Pa]."""
    force = force_at(built, stretched(sheet, a, b))
    mean = -(force[:, :2] * sheet.points).sum(axis=0) / volume(sheet)
    exact = rubber.stress(a, b)
    for term in getattr(built.simulation.force, "prony", ()):
        # Nothing has relaxed yet; the terms are incompressible.
        exact = exact + 2.0 * term.c10 * (np.array([a, b]) - 1.0 / (np.array([a, b]) * (a * b) ** 2))
    return float(np.abs(mean - exact).max() / np.abs(exact).max()), mean


# Cases: material --------------------------------------------------------------------------------------------


def stiffness(rubber: Rubber, share_of_lock: float | None = None) -> Callable[[Trial], Finding]:
    """A sheet of this rubber: its stress where it is stretched uniformly, then its motion from a rough start."""

    def find(trial: Trial) -> Finding:
        sheet, a, b = square(), 1.3, 0.9
        if share_of_lock is not None:
            a = b = float(bisect(lambda x: rubber.share_of_lock(x) - share_of_lock, 1.001, 40.0))
        known = isinstance(trial.simulation(sheet, rubber).force.material, NeoHookean | Gent)
        error, stress = stress_error(trial.built(sheet, rubber), sheet, rubber, a, b)
        small = 1.0 if share_of_lock is None else 1.0 - share_of_lock
        start = stretched(sheet, a, b) + small * (smooth(sheet, 0.02) + rough(sheet, 0.01))
        time = duration(trial, sheet, rubber, 2.0)
        found = attempt(
            trial,
            lambda share: trial.simulation(
                sheet, rubber, loads=[Fixed(sheet.edges("all"))], initial_displacement=start,
                solver=Explicit(time, frames=20, safety=share),
            ),
            rubber.energy(a, b) * volume(sheet),
        )  # fmt: skip
        if found.verdict == CLEAN:
            return replace(found, number=None)
        if not known:
            return replace(found, unit=found.unit or "energy ")
        return replace(found, number=error, field=stress, unit="")

    return find


def beyond_lock(trial: Trial) -> Finding:
    """Stretched by half beyond 99 % of the lock: the run must end with a message, or swell as it should."""
    rubber, sheet = Rubber(lock=20.0, ratio=NEARLY), square()
    a = 1.5 * float(bisect(lambda x: rubber.share_of_lock(x) - 0.99, 1.001, 40.0))
    simulation = trial.simulation(
        sheet, rubber, loads=[Fixed(sheet.edges("all"))], initial_displacement=stretched(sheet, a, a),
        solver=Explicit(duration(trial, sheet, rubber, 1.0), frames=20),
    )  # fmt: skip
    return run_once_at(trial, simulation, math.inf)


def relaxing(relaxation: float) -> Callable[[Trial], Finding]:
    """A sheet whose stress relaxes in far less time than a step, or in far more than a run, from a rough start."""

    def find(trial: Trial) -> Finding:
        sheet, rubber = square(), replace(RUBBER, relaxation=relaxation)
        if not isinstance(trial.simulation(sheet, rubber).force, Visco | ViscoBondBased):
            raise NotThere("nothing relaxes")
        start, time = stretched(sheet, 1.3, 0.9) + smooth(sheet, 0.1), duration(trial, sheet, rubber, 2.0)
        return attempt(
            trial,
            lambda share: trial.simulation(
                sheet, rubber, loads=[Fixed(sheet.edges("all"))], initial_displacement=start,
                solver=Explicit(time, frames=20, safety=share),
            ),
            rubber.energy(1.3, 1.0) * volume(sheet),
        )  # fmt: skip

    return find


# Cases: geometry and units ----------------------------------------------------------------------------------


def moved(trial: Trial, sheet: Sheet, rubber: Rubber) -> np.ndarray:
    """Displacement over the side after a while of smooth motion, steps of the same count in any units."""
    built = trial.built(
        sheet, rubber, loads=[Fixed(sheet.edges("all"))],
        initial_displacement=stretched(sheet, 1.2, 1.1) + smooth(sheet, 0.05),
    )  # fmt: skip
    built.force.start()
    side = float(np.ptp(sheet.points, axis=0)[0])
    dt = 0.005 * side / math.sqrt(rubber.mu / sheet.density)
    drive(built, dt, 200)
    return built.to_numpy(built.state.displacement) / side


def scaled(length: float = 1.0, thickness: float = THICKNESS) -> Callable[[Trial], Finding]:
    """The same sheet in a unit `1/length` metres long (kg and s stay), or of another thickness, against the first."""

    def find(trial: Trial) -> Finding:
        rubber = replace(RUBBER, mu=MU / length)
        sheet = square(size=length, thickness=thickness * length, density=DENSITY / length**3)
        here, there = moved(trial, sheet, rubber), moved(trial, square(), RUBBER)
        if not np.isfinite(here).all():
            return Finding(WRONG, None, "not finite")
        error = float(np.abs(here - there).max() / np.abs(there).max())
        limit = 2e-5 if trial.bits == 32 else 1e-12
        return Finding(STABLE if error < limit else WRONG, error, field=here)

    return find


def graded(points: int = 8, ratio: float = 10.0) -> Sheet:
    """A square cloud whose spacing grows by `ratio` from one corner to the other, in both directions."""
    steps = np.geomspace(1.0, ratio, points - 1)
    x = np.concatenate([[0.0], np.cumsum(steps)]) / steps.sum()
    grid = np.column_stack([g.ravel() for g in np.meshgrid(x, x)])
    corner = np.arange(points * points).reshape(points, points)
    a, b, c, d = corner[:-1, :-1].ravel(), corner[:-1, 1:].ravel(), corner[1:, 1:].ravel(), corner[1:, :-1].ravel()
    triangles = np.vstack([np.column_stack([a, b, c]), np.column_stack([a, c, d])])
    # Horizons count in about the widest spacing: no family must miss its neighbours.
    spacing = 0.8 * float(steps[-1] / steps.sum())
    return Sheet.from_points(grid, thickness=THICKNESS, density=DENSITY, triangles=triangles, spacing=spacing)


def cloud(make: Callable[[], Sheet]) -> Callable[[Trial], Finding]:
    """A sheet on a cloud, stretched and shaken."""

    def find(trial: Trial) -> Finding:
        sheet = make()
        edge = sheet.edges("all")
        start = stretched(sheet, 1.2, 1.1)
        velocity = smooth(sheet, 0.3)
        velocity[edge] = 0.0
        time = duration(trial, sheet, RUBBER, 2.0)

        def simulation(share: float) -> Simulation:
            return trial.simulation(
                sheet, loads=[Fixed(edge)], initial_displacement=start, initial_velocity=velocity,
                solver=Explicit(time, frames=20, safety=share),
            )  # fmt: skip

        return attempt(trial, simulation, 1.2 * RUBBER.energy(1.2, 1.1) * volume(sheet))

    return find


# Cases: the step --------------------------------------------------------------------------------------------


def largest_share(built: Built, start: np.ndarray, shares: Sequence[float], steps: int) -> tuple[float, float]:
    """The largest share of the estimate up to which small motion stays bounded, and the first at which it does not."""
    velocity = 1e-5 * np.random.default_rng(1).normal(size=start.shape)
    velocity[built.held != 0] = 0.0
    kind = built.state.displacement.numpy().dtype
    settle(built, start)
    stable, held = stable_step(built), 0.0
    at_rest = force_at(built, start)
    # A dead load that keeps the start in equilibrium leaves small motion alone.
    built.state.external.assign((-at_rest).astype(kind))
    for share in shares:
        settle(built, start)
        built.state.velocity.assign(velocity.astype(kind))
        drive(built, share * stable, steps)
        grown = np.abs(built.to_numpy(built.state.velocity)).max() / np.abs(velocity).max()
        if not grown < 30.0:
            return held, share
        held = share
    return held, math.inf


def step_bound(make: Callable[[], Sheet], a: float, b: float) -> Callable[[Trial], Finding]:
    """The estimate must be a bound, and a sharp one: stable at 1.0, unstable not far above."""

    def find(trial: Trial) -> Finding:
        from warp_pd import PointForce

        sheet = make()
        edge = sheet.edges("left")
        # The load's value is replaced by what keeps the stretched sheet in equilibrium.
        loads = [Fixed(edge), PointForce(np.arange(sheet.size), (0.0, 0.0, 1e-30))]
        built = trial.built(sheet, loads=loads)
        shares = (0.5, 0.8, 1.0, 1.02, 1.05, 1.1, 1.2)
        held, broke = largest_share(built, stretched(sheet, a, b), shares, 400 if trial.short else 1000)
        if held < 1.0 and largest_share(built, stretched(sheet, a, b), (0.2,), 5000)[0] == 0.0:
            held = 0.0
        verdict = STABLE if held >= 1.0 else SMALLER
        remark = f"unstable at {broke:g}" if broke < math.inf else "stable at all"
        if held >= 1.0 and broke > 1.1:
            verdict, remark = WRONG, f"{remark}: the estimate wastes steps"
        if held == 0.0:
            verdict, remark = WRONG, "small motion grows at any step: the force has no potential"
        return Finding(verdict, held, remark)

    return find


# Cases: few bonds -------------------------------------------------------------------------------------------


def keep_bonds(built: Built, pairs: Sequence[tuple[int, int]]) -> None:
    """Break all bonds but those between these points."""
    families = built.force.families
    n, members = built.simulation.sheet.size, families.members
    exists = families.rows_of_points(families.exists)
    head = (
        np.arange(n)[:, None] + families.shift[None] if families.neighbours is None else families.neighbours
    )  # fmt: skip
    wanted = {(a, b) for a, b in pairs} | {(b, a) for a, b in pairs}
    keep = np.array([[(i, int(head[i, k])) in wanted for k in range(members)] for i in range(n)])
    built.force.alive.assign(np.ascontiguousarray(pack(exists & keep).T))


def few_bonds(pairs: Sequence[tuple[int, int]]) -> Callable[[Trial], Finding]:
    """Only these bonds of a sheet of 5 x 5 points stand; it is displaced, shaken and left alone."""

    def find(trial: Trial) -> Finding:
        sheet = square(5)
        rng = np.random.default_rng(2)
        velocity = 0.05 * rng.normal(size=(sheet.size, 3))
        built = trial.built(
            sheet, initial_displacement=0.05 * sheet.spacing * rng.normal(size=(sheet.size, 3)),
            initial_velocity=velocity, damage=CriticalStretch(1e3),
        )  # fmt: skip
        keep_bonds(built, pairs)
        built.force.start()
        before, momentum = energies(built), (built.to_numpy(built.mass)[:, None] * velocity).sum(axis=0)
        dt = 0.02 * sheet.spacing / math.sqrt(MU / DENSITY)
        drive(built, dt, 500 if trial.short else 3000)
        kinetic, strain = energies(built)
        if why := caught(built, np.array([sum(before), kinetic + strain]), dt):
            return Finding(CLEAN, None, f"a run ends with a message: {why}")
        speed = built.to_numpy(built.state.velocity)
        error = np.abs((built.to_numpy(built.mass)[:, None] * speed).sum(axis=0) - momentum).max()
        error /= (built.to_numpy(built.mass)[:, None] * np.abs(velocity)).sum()
        # Without an energy of the law, the sheet's own at this strain bounds what a few bonds can store.
        budget = before[0] + before[1]
        if math.isnan(strain):
            standing = 1.0 - float(built.to_numpy(built.damage).mean())
            budget = tension_at_rest(built.simulation, before[0] + 0.01 * MU * volume(sheet), standing)
        field = built.to_numpy(built.state.displacement)
        if math.isnan(strain):
            good = error < 1e-3 and kinetic < (1.0 + ENERGY_ERROR) * budget
            return Finding(STABLE if good else WRONG, kinetic / budget, field=field, unit=KINETIC)
        number = max(float(error), abs(kinetic + strain - budget) / budget)
        return Finding(STABLE if number < 1e-3 else WRONG, number, field=field)

    return find


# Cases: shapes ----------------------------------------------------------------------------------------------


def zero_energy(trial: Trial) -> Finding:
    """Frequency of the softest of the excitations finer than a family, over the largest of the sheet."""
    sheet = square(21)
    a, b = 1.2, 1.1
    built = trial.built(sheet, loads=[Fixed(sheet.edges("all"))], initial_displacement=stretched(sheet, a, b))
    largest = 2.0 / stable_step(built)
    i, j = np.indices((21, 21)).reshape(2, -1)
    signs = {"checkerboard": (-1.0) ** (i + j), "stripes": (-1.0) ** i, "every third": np.cos(2.0 * np.pi / 3.0 * i)}
    # Away from the edges, where families are one-sided and feel them.
    middle = (np.sin(np.pi * sheet.points[:, 0]) * np.sin(np.pi * sheet.points[:, 1])) ** 4
    mass = built.to_numpy(built.mass)[:, None]
    found = {}
    for name, sign in signs.items():
        for c, axis in enumerate("xyz"):
            v = np.zeros((sheet.size, 3))
            v[:, c] = sign * middle
            v[sheet.edges("all")] = 0.0
            step = 1e-3 * sheet.spacing
            base = stretched(sheet, a, b)
            change = (force_at(built, base - step * v) - force_at(built, base + step * v)) / (2.0 * step)
            squared = float((v * change).sum() / (mass * v * v).sum())
            found[f"{name} along {axis}"] = math.copysign(math.sqrt(abs(squared)), squared) / largest
    worst = min(found, key=lambda k: found[k])
    number = found[worst]
    return Finding(STABLE if number > 0.05 else WRONG, number, worst)


def rotation(degrees: float, axis: tuple[float, float, float]) -> np.ndarray:
    """Rotation matrix (Rodrigues)."""
    n = np.array(axis) / np.linalg.norm(axis)
    cross = np.array([[0.0, -n[2], n[1]], [n[2], 0.0, -n[0]], [-n[1], n[0], 0.0]])
    angle = np.deg2rad(degrees)
    return np.eye(3) + np.sin(angle) * cross + (1.0 - np.cos(angle)) * cross @ cross


def turned_sheet(degrees: float) -> Callable[[Trial], Finding]:
    """A strained sheet turned as a whole: its forces must turn with it."""

    def find(trial: Trial) -> Finding:
        sheet = square()
        place = np.column_stack([sheet.points, np.zeros(sheet.size)])
        start = stretched(sheet, 1.2, 1.1) + smooth(sheet, 0.03)
        built = trial.built(sheet)
        force = force_at(built, start)
        worst = 0.0
        for axis in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0), (1.0, 2.0, 3.0)):
            turn = rotation(degrees, axis)
            there = force_at(built, (place + start) @ turn.T - place)
            worst = max(worst, float(np.abs(there - force @ turn.T).max() / np.abs(force).max()))
        limit = 1e-3 if trial.bits == 32 else 1e-10
        return Finding(STABLE if worst < limit else WRONG, worst, field=force)

    return find


def mirrored(trial: Trial) -> Finding:
    """The whole sheet inside out: a surface in space turned over, it must carry the mirrored force of rest, or none."""
    sheet = square()
    built = trial.built(sheet)
    start = np.column_stack([-2.0 * sheet.points[:, 0], np.zeros((sheet.size, 2))])
    force = force_at(built, start) - force_at(built, np.zeros_like(start)) * [-1.0, 1.0, 1.0]
    number = float(np.abs(force).max() / (MU * THICKNESS * sheet.spacing))
    limit = 1e-3 if trial.bits == 32 else 1e-10
    return Finding(STABLE if number < limit else WRONG, number)


def dragged(where: Callable[[Sheet, int], np.ndarray]) -> Callable[[Trial], Finding]:
    """One inner point is put elsewhere, and let go."""

    def find(trial: Trial) -> Finding:
        sheet = square(7)
        point = sheet.nearest(0.5, 0.5)
        start = np.zeros((sheet.size, 3))
        start[point] = where(sheet, point)
        built = trial.built(sheet, loads=[Fixed(sheet.edges("all"))])
        force = force_at(built, start)
        if not np.isfinite(force).all():
            return Finding(CLEAN, None, "the force is not finite, which the first frame reports")
        time = duration(trial, sheet, RUBBER, 2.0)

        def simulation(share: float) -> Simulation:
            return trial.simulation(
                sheet, loads=[Fixed(sheet.edges("all"))], initial_displacement=start,
                solver=Explicit(time, frames=40, safety=share),
            )  # fmt: skip

        # The work to put it there, at the most: a quarter of the force on the way.
        budget = float(np.linalg.norm(start[point]) * np.linalg.norm(force, axis=1).max())
        return replace(attempt(trial, simulation, max(budget, 1e-12)), field=force)

    return find


def beside(sheet: Sheet, point: int) -> np.ndarray:
    """The point's neighbour to the right lies, seen from it, a quarter turn off: upwards, out of the plane."""
    return np.array([sheet.spacing, 0.0, -sheet.spacing])


def across(sheet: Sheet, point: int) -> np.ndarray:
    """The point has passed its neighbour to the right: that bond is turned by 180 degrees, triangles inside out."""
    return np.array([1.9 * sheet.spacing, 0.0, 0.0])


def compression(trial: Trial) -> Finding:
    """Pushed together to half its size, nearly flat: it must buckle and crumple, not blow up."""
    sheet = square()
    start = stretched(sheet, 0.5, 0.5) + rough(sheet, 0.01)
    time = duration(trial, sheet, RUBBER, 4.0)

    def simulation(share: float) -> Simulation:
        return trial.simulation(
            sheet, loads=[Fixed(sheet.edges("all"))], initial_displacement=start,
            solver=Explicit(time, frames=40, safety=share),
        )  # fmt: skip

    return attempt(trial, simulation, RUBBER.energy(0.5, 0.5) * volume(sheet))


# Cases: long runs -------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Samples:
    """Kinetic energy, stored energy with viscous loss, and that loss along a long run [J], and its steps."""

    kinetic: np.ndarray
    strain: np.ndarray
    lost: np.ndarray
    steps: int


def long_run(trial: Trial, built: Built, dt: float, steps: int, stored: Callable[[], float]) -> Samples:
    """Steps in two hundred parts, or as many as the time allows; `stored` gives the strain energy [J]."""
    run_once(built.workspace.device, built.workspace.stages["setup"])
    built.step.fill_(dt)
    part = max(10, steps // 200)
    many = built.workspace.sequence("step", repeat=min(part, 1000))
    rounds = max(1, part // min(part, 1000))
    kinetic, strain, loss, done = [energies(built)[0]], [stored()], [lost(built)], 0
    begin = perf_counter()
    while done < steps and perf_counter() - begin < trial.seconds:
        for _ in range(rounds):
            many.run()
        done += rounds * many.repeat
        kinetic.append(energies(built)[0])
        strain.append(stored())
        loss.append(lost(built))
        if caught(built, np.array(kinetic) + np.array(strain), dt):
            break
    return Samples(np.array(kinetic), np.array(strain), np.array(loss), done)


def own_or_nodal(trial: Trial, built: Built) -> Callable[[], float]:
    """The law's stored energy with viscous loss; for one without, the nodal law's of the same displacement.

    ViscoBondBased has an energy of its own but for what relaxes.
    """
    if built.strain_energy is not None:
        return lambda: energies(built)[1]
    own = built.simulation.force
    law = replace(own, prony=()) if isinstance(own, ViscoBondBased) else Nodal(RUBBER.material)
    other = Simulation(built.simulation.sheet, law, Explicit(1.0)).build(trial.device, trial.bits)
    other.workspace.compile()

    def stored() -> float:
        other.state.displacement.assign(built.state.displacement.numpy())
        return energies(other)[1]

    return stored


def caught(built: Built, total: np.ndarray, dt: float) -> str:
    """Why a run of the product would have ended with a message, or nothing."""
    if not finite(built):
        return "it stopped being finite"
    if np.linalg.norm(built.to_numpy(built.state.velocity), axis=1).max() * dt > built.force.families.horizon:
        return "points move more than a horizon in a step"
    gained = built.force.has_energy and not (total / total[0]).max() <= 1.0 + MOST_GAIN
    return "it gained energy" if gained else ""


def count_of(steps: int) -> str:
    """Steps for people."""
    return f"{shortest(steps)} steps"


def oscillation(trial: Trial) -> Finding:
    """Undamped, for a million steps: drift of the energy over the kinetic energy of the start."""
    sheet = square(5)
    velocity = 2.0 * smooth(sheet, 0.1)
    built = trial.built(
        sheet, loads=[Fixed(sheet.edges("all"))], initial_displacement=stretched(sheet, 1.1, 1.1),
        initial_velocity=velocity,
    )  # fmt: skip
    built.force.start()
    stored = own_or_nodal(trial, built)
    dt = 0.2 * stable_step(built)
    s = long_run(trial, built, dt, 2000 if trial.short else trial.steps, stored)
    total = s.kinetic + s.strain
    quarter = max(1, len(total) // 4)
    if why := caught(built, total, dt):
        return Finding(CLEAN, None, f"a run ends with a message: {why} within {count_of(s.steps)}")
    # The first quarter shares out the energy between the modes, on which the energy of central differences depends.
    drift = float((total[-quarter:].mean() - total[quarter : 2 * quarter].mean()) / s.kinetic[0])
    if built.force.internal:
        number = gain_of(total - s.lost, s.lost) / s.kinetic[0]
        number = max(number, abs(drift)) if built.force.has_energy else number
        left = (total - s.lost)[-quarter:].mean() / (total - s.lost)[0]
        remark = f"{100.0 * left:.3g} % of the energy is left, {count_of(s.steps)}"
        return Finding(STABLE if number < 0.05 and left < 1.0 else WRONG, number, remark, unit=GAIN)
    return Finding(STABLE if abs(drift) < 0.05 else WRONG, drift, count_of(s.steps))


def gain_of(energy: np.ndarray, lost: np.ndarray) -> float:
    """Largest rise of a viscous sheet's energy from one twentieth of the run to the next, or fall of its loss [J]."""
    parts = np.array([part.mean() for part in np.array_split(energy, min(20, len(energy)))])
    return float(max(np.diff(parts).max(initial=0.0), -np.diff(lost).min(initial=0.0)))


def spin(trial: Trial) -> Finding:
    """A free sheet spins about a slanted axis: drift of its energy or angular momentum over the start's."""
    sheet = square(5)
    place = np.column_stack([sheet.points - sheet.points.mean(axis=0), np.zeros(sheet.size)])
    velocity = np.cross(np.array([0.2, 0.1, 0.3]), place)
    if isinstance(trial.simulation(sheet).force, ViscoBondBased):
        raise NotThere("under tension at rest, a free sheet of this law contracts: it has no shape to keep")
    built = trial.built(sheet, initial_velocity=velocity)
    stored = own_or_nodal(trial, built)
    mass = built.to_numpy(built.mass)[:, None]

    def angular() -> np.ndarray:
        now = place + built.to_numpy(built.state.displacement)
        return (mass * np.cross(now, built.to_numpy(built.state.velocity))).sum(axis=0)

    before = angular()
    dt = 0.5 * stable_step(built)
    s = long_run(trial, built, dt, 2000 if trial.short else max(2000, trial.steps // 10), stored)
    total = s.kinetic + s.strain
    if why := caught(built, total, dt):
        return Finding(CLEAN, None, f"a run ends with a message: {why} within {count_of(s.steps)}")
    turn = float(np.linalg.norm(angular() - before) / np.linalg.norm(before))
    drift = float(np.abs(total / total[0] - 1.0).max())
    turns = np.linalg.norm([0.2, 0.1, 0.3]) * dt * s.steps / (2.0 * np.pi)
    number = max(turn, drift)
    remark = f"{'momentum' if turn > drift else 'energy'}, {count_of(s.steps)}, {turns:.3g} turns"
    return Finding(STABLE if number < 0.02 else WRONG, number, remark)


# Cases: rupture and contact ---------------------------------------------------------------------------------


def ball_scene(trial: Trial, speed: float, share: float, frames: int = 2) -> Simulation:
    """A ball at `speed` times the shear wave goes through a clamped sheet that tears at a stretch of 1.3."""
    sheet = square(13)
    return trial.simulation(
        sheet,
        loads=[Fixed(sheet.edges("all"))],
        contact=RigidBall(0.3, (0.5, 0.5, 0.15 + 1e-3), (0.0, 0.0, -speed)),
        damage=CriticalStretch(1.3),
        solver=Explicit(0.7 / speed, frames=frames, safety=share),
    )


def ball(speed: float) -> Callable[[Trial], Finding]:
    """The run must end, balance its energy, and the ball must not pass the sheet unnoticed."""

    def find(trial: Trial) -> Finding:
        found = Finding(NONE)
        for share in SHARES:
            simulation = ball_scene(trial, speed, share)
            # What the ball gives to the mass in its way, four times over.
            budget = 4.0 * DENSITY * THICKNESS * np.pi * 0.15**2 * (2.0 * speed) ** 2
            found = run_once_at(trial, simulation, budget)
            struck = passed_through(trial, simulation) if found.verdict == STABLE else None
            if struck is not None:
                found = replace(found, verdict=WRONG, remark=struck)
            found = replace(found, field=None)
            if found.verdict == STABLE:
                return found if share == SHARES[0] else replace(found, verdict=SMALLER, remark=f"at {share:g}")
        return replace(found, remark=f"at {SHARES[-1]:g}: {found.remark}")

    return find


class Unwatched:
    """Recorder that looks at nothing, so that what the ball gives each point adds up over the whole run."""

    frame_index, since_estimate, stable_dt = 0, 0, None

    def frame(self, index: int, now: float, steps: int, dt: float) -> None:
        """Nothing."""


def passed_through(trial: Trial, simulation: Simulation) -> str | None:
    """What is wrong if the ball passed points in its way without a touch, or None."""
    built = simulation.build(trial.device, trial.bits)
    built.workspace.compile()
    run_once(built.workspace.device, built.workspace.stages["setup"])
    recorder: Any = Unwatched()
    simulation.solver.march(built, recorder)
    under = np.hypot(*(simulation.sheet.points - 0.5).T) < 0.1
    left = int((built.to_numpy(built.state.impulse)[under] == 0.0).all(axis=1).sum())
    return f"the ball passed {left} of the {int(under.sum())} points in its way without a touch" if left else None


def all_at_once(trial: Trial) -> Finding:
    """Every bond breaks in the first step: all energy is released, all points fly free."""
    sheet = square()
    velocity = 0.1 * np.random.default_rng(3).normal(size=(sheet.size, 3))
    budget = RUBBER.energy(1.6, 1.6) * volume(sheet)
    simulation = trial.simulation(
        sheet, initial_displacement=stretched(sheet, 1.6, 1.6), initial_velocity=velocity, damage=CriticalStretch(1.3),
        solver=Explicit(0.2, frames=20),
    )  # fmt: skip
    found = run_once_at(trial, simulation, budget)
    if found.verdict != STABLE:
        return found
    result = simulation.run(device=trial.device, precision=trial.bits)
    if result.history[-1]["mean_damage"] < 1.0:
        return Finding(WRONG, found.number, "some bonds still stand")
    return found


class StopAt:
    """Reporter that stops a run after one of its frames."""

    def __init__(self, index: int) -> None:
        self.index = index

    def begin(self, built: Built) -> None:
        """Nothing."""

    def compiled(self, seconds: float) -> None:
        """Nothing."""

    def frame(self, recorder: Any) -> None:
        """Ask for the stop."""
        recorder.stop_asked = recorder.stop_asked or recorder.frame_index + 1 >= self.index

    def residual(self, steps: int, residual: float, tolerance: float) -> None:
        """Nothing."""

    def close(self) -> None:
        """Nothing."""


def left_in(folder: Path) -> dict[str, np.ndarray]:
    """Arrays of a restart file."""
    with np.load(folder / "restart.npz") as stored:
        return {name: stored[name] for name in stored.files if name not in ("numbers", "noise")}


def differing(one: dict[str, np.ndarray], two: dict[str, np.ndarray]) -> int:
    """How many numbers differ in any bit."""
    return sum(int((a.view(np.uint8) != two[name].view(np.uint8)).sum()) for name, a in one.items())


def restarted(trial: Trial) -> Finding:
    """Stopped in the middle of the tear and resumed, against the uninterrupted run: bytes that differ."""
    options = {"device": trial.device, "precision": trial.bits, "usd": False, "pictures": False}
    with tempfile.TemporaryDirectory() as name:
        whole, parts = Path(name) / "whole", Path(name) / "parts"
        full = ball_scene(trial, 1.0, 0.2, 40).run(out=whole, **options)
        torn = [row["mean_damage"] for row in full.history]
        if full.status == DIVERGED or not torn[-1] > 0.0:
            return Finding(NONE, None, f"the tear {full.status}: {full.summary['message']}")
        middle = int(np.flatnonzero(np.array(torn) > 0.5 * torn[-1])[0])
        first = ball_scene(trial, 1.0, 0.2, 40).run(out=parts, reporter=StopAt(middle), **options)
        second = ball_scene(trial, 1.0, 0.2, 40).run(out=parts, resume=True, **options)
        if first.status != "interrupted" or second.status != full.status:
            return Finding(WRONG, None, f"{first.status}, then {second.status}")
        found = differing(left_in(whole), left_in(parts))
    return Finding(STABLE if found == 0 else WRONG, float(found), f"stopped at frame {middle} of {len(torn) - 1}")


def repeated(trial: Trial) -> Finding:
    """The same tear twice on the same device: bytes of displacement and velocity that differ."""
    frames = [ball_scene(trial, 1.0, 0.2, 40).run(device=trial.device, precision=trial.bits).frame for _ in range(2)]
    one, two = ({"u": f.displacement, "v": f.velocity} for f in frames)
    found = differing(one, two)
    return Finding(STABLE if found == 0 else WRONG, float(found))


ENERGY = "energy error"
STRESS = "error of the mean stress"
CASES: tuple[Case, ...] = (
    *(
        Case(f"K/mu = {nice(ratio)}", STRESS, stiffness(Rubber(ratio=ratio)), fast=ratio in (1.0, 1e6))
        for ratio in (1.0, 10.0, 100.0, 1e3, 1e4, 1e5, 1e6)
    ),
    *(
        Case(
            f"99 % of the lock, Jm = {nice(lock)}",
            STRESS,
            stiffness(Rubber(lock=lock, ratio=NEARLY), 0.99),
            fast=lock == 1.0,
        )
        for lock in (200.0, 50.0, 10.0, 3.0, 1.0)
    ),
    Case("stretched beyond the lock, Jm = 20", ENERGY, beyond_lock, fast=True),
    *(Case(f"relaxation in {nice(time)} s", ENERGY, relaxing(time)) for time in (1e-9, 1e-3, 1e9)),
    *(
        Case(f"thickness {nice(h)} of the side", "change of the motion", scaled(thickness=h), fast=h == 1e-6)
        for h in (1e-6, 1e-3, 1.0)
    ),
    Case("units: millimetres", "change of the motion", scaled(length=1e3), fast=True),
    Case("units: kilometres", "change of the motion", scaled(length=1e-3), fast=True),
    Case("step: at rest", "stable share of the estimate", step_bound(square, 1.0, 1.0)),
    Case("step: stretched", "stable share of the estimate", step_bound(square, 1.3, 1.1), fast=True),
    Case(
        "step: jittered, stretched",
        "stable share of the estimate",
        step_bound(lambda: Sheet.filled(1.0, 1.0, thickness=0.01, density=1e3, points=9, jitter=0.4), 1.3, 1.1),
    ),
    Case(
        "cloud: jittered by 0.45",
        ENERGY,
        cloud(lambda: Sheet.filled(1.0, 1.0, thickness=0.01, density=1e3, points=11, jitter=0.45)),
        fast=True,
    ),
    Case("cloud: graded 10:1", ENERGY, cloud(graded)),
    Case("one bond", ENERGY, few_bonds([(12, 13)]), fast=True),
    Case("two bonds", ENERGY, few_bonds([(12, 13), (12, 17)])),
    Case("collinear bonds", ENERGY, few_bonds([(10, 11), (11, 12), (12, 13), (13, 14), (10, 12), (12, 14)])),
    Case("a chain", ENERGY, few_bonds([(0, 6), (6, 7), (7, 13), (13, 14), (14, 18), (18, 22)])),
    Case("an isolated point", ENERGY, few_bonds([])),
    Case("zero-energy excitations", "softest frequency over the largest", zero_energy, fast=True),
    Case("sheet turned by 90°", "change of the forces", turned_sheet(90.0)),
    Case("sheet turned by 180°", "change of the forces", turned_sheet(180.0), fast=True),
    Case("sheet inside out", "force over mu h dx", mirrored),
    Case("a bond turned by 90°", ENERGY, dragged(beside)),
    Case("a bond turned by 180°, inversion", ENERGY, dragged(across), fast=True),
    Case("compression to half size", ENERGY, compression, fast=True),
    Case("ball at the wave speed", ENERGY, ball(1.0)),
    Case("ball at 10 times", ENERGY, ball(10.0)),
    Case("ball at 100 times", ENERGY, ball(100.0), fast=True),
    Case("every bond in one step", ENERGY, all_at_once, fast=True),
    Case("restart in the middle of a tear", "bytes that differ", restarted, fast=True),
    Case("two runs on one device", "bytes that differ", repeated, fast=True),
    Case("rigid spin", "drift", spin, fast=True),
    Case("undamped oscillation", "drift of the energy", oscillation, fast=True),
)


# The table --------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Cell:
    """What the table says of a case and a law: float32's finding, float64's, how far apart they are, and its stamp."""

    verdict: str
    number: float | None
    remark: str
    double: float | None
    double_verdict: str
    difference: float | None
    seconds: float
    unit: str = ""
    made: str = ""

    def text(self) -> str:
        """For the table."""
        if self.verdict == NONE:
            return "n/a"
        shown = "" if self.number is None else f" {self.unit}{shortest(self.number)}"
        share = f" {self.remark}" if self.verdict == SMALLER and self.remark.startswith("at ") else ""
        mark = "" if self.verdict == self.double_verdict else f" (float64: {self.double_verdict})"
        return f"{self.verdict}{share}{':' if shown else ''}{shown}{mark}"


def shortest(number: float) -> str:
    """Two digits."""
    return nice(float(f"{number:.2g}"))


def cell(name: str, trial: Trial) -> Cell:
    """Run the case of that name in both precisions."""
    begin, case = perf_counter(), next(case for case in CASES if case.name == name)
    found = {}
    for bits in (32, 64):
        try:
            found[bits] = case.find(replace(trial, bits=bits))
        except NotThere as reason:
            found[bits] = Finding(NONE, None, str(reason))
        except InputError as error:
            found[bits] = Finding(CLEAN, None, f"refused: {error}")
    single, double = found[32], found[64]
    difference = None
    if single.field is not None and double.field is not None:
        difference = float(np.abs(single.field - double.field).max() / max(np.abs(double.field).max(), 1e-300))
    elif single.number is not None and double.number is not None:
        difference = abs(single.number - double.number)
    return Cell(
        single.verdict,
        single.number,
        single.remark,
        double.number,
        double.verdict,
        difference,
        perf_counter() - begin,
        single.unit,
    )


Table = dict[str, dict[str, Cell]]
Task = tuple[str, Trial]


def run_all(tasks: Sequence[Task], jobs: int) -> Iterator[tuple[Task, Cell]]:
    """Run cases, as many at a time as there are jobs; hands each over when it is done."""
    if jobs == 1:
        yield from ((task, cell(*task)) for task in tasks)
        return
    # A process that was forked could not use CUDA.
    context = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(jobs, context, initializer=end_with_parent) as pool:
        running = {pool.submit(cell, *task): task for task in tasks}
        try:
            for future in as_completed(running):
                yield running[future], future.result()
        finally:
            pool.shutdown(cancel_futures=True)


def end_with_parent() -> None:
    """Leave no process behind when the one that started this one is killed."""
    parent = multiprocessing.parent_process()

    def wait() -> None:
        if parent is not None:
            parent.join()
        os._exit(1)

    threading.Thread(target=wait, daemon=True).start()


def load(path: Path, device: str) -> Table:
    """The cells of an earlier call; none where there is no file.

    Raises:
        InputError: if they are of another device.
    """
    if not path.exists():
        return {}
    cells = {name: {law: Cell(**c) for law, c in row.items()} for name, row in json.loads(path.read_text()).items()}
    made = {c.made for row in cells.values() for c in row.values()}
    if not all(text.startswith(f"on {device},") for text in made):
        raise InputError(
            f"--out: {path} holds what was {sorted(made)[0]!r}; allowed on {device!r} is a page of its own"
        )
    return cells


def in_order(cells: Table) -> Table:
    """The cells in the order of the cases and laws."""
    rows = {case.name: cells[case.name] for case in CASES if case.name in cells}
    return {name: {law: row[law] for law in LAWS if law in row} for name, row in rows.items()}


def save(out: Path, cells: Table) -> None:
    """Write the page and, beside it, the numbers."""
    numbers = {name: {law: asdict(c) for law, c in row.items()} for name, row in cells.items()}
    out.parent.mkdir(parents=True, exist_ok=True)
    write_aside(out.with_suffix(".json"), json.dumps(numbers, indent=1) + "\n")
    write_aside(out, page(cells, out.with_suffix(".json").name))


def table(cells: Table, laws: Sequence[str], text: Callable[[Cell], str]) -> str:
    """Cases down, laws across; nothing where none has run."""
    numbers = {case.name: case.number for case in CASES}
    lines = [f"| case | number | {' | '.join(laws)} |", "|---" * (len(laws) + 2) + "|"]
    for name, row in cells.items():
        lines.append(
            f"| {name} | {numbers[name]} | {' | '.join(text(row[law]) if law in row else '' for law in laws)} |"
        )
    return "\n".join(lines)


def remarks(cells: Table) -> str:
    """What the cells that are not simply stable say, one line a remark."""
    said: dict[tuple[str, str], list[str]] = {}
    none: dict[str, tuple[str, dict[str, None], dict[str, None]]] = {}
    for name, row in cells.items():
        for law, c in row.items():
            if c.remark not in c.text() and (c.verdict != STABLE or "steps" in c.remark):
                # Numbers of points and times differ from law to law; the cause is after the colon.
                reason = c.remark.split("likely cause: ")[-1] if c.verdict == CLEAN else c.remark
                if c.verdict == NONE:
                    # Reasons that differ in numbers alone are told once.
                    _, names, laws = none.setdefault(re.sub(r"\d\S*", "", reason), (reason, {}, {}))
                    names[name] = laws[law] = None
                else:
                    said.setdefault((c.verdict, reason), []).append(f"{name}, {law}")
    lines = [f"- {verdict}, {reason}: {'; '.join(places)}" for (verdict, reason), places in said.items()]
    lines += [f"- {NONE}, {reason}: {'; '.join(names)}: {', '.join(laws)}" for reason, names, laws in none.values()]
    return "\n".join(lines)


# What the limits of a group of cases are, and what to do about them; by how the names of its cases begin.
ADVICE = {
    "K/mu = ": "Nothing to do: the volume change is found from the strain, not from a number near one.",
    "99 % of the lock, Jm = ": f"K/mu is {nice(NEARLY)} here: softer sheets swell instead. Near the "
    "lock a sheet stiffens within a few steps: lower `safety`. Laws whose forces do not balance beside an edge under "
    "uniform stress, nodal and closed form, reach the lock there and the run ends with a message; take `corrected`.",
    "relaxation": "Any: the update is exact whatever the step is over the relaxation time. The series that is printed "
    "(VE eq. 60) grows without bound where a term relaxes within a step, and fast motion makes it: take `exact`.",
    "thickness": "Any: neither strain nor step depends on it.",
    "units": "Any: lengths are kept over the horizon and areas over that of a point.",
    "step": "The estimate is a bound. Undamped, laws without a potential grow slowly at any step: add damping, or take "
    "`plain` or `corrected`.",
    "cloud": "A sheet that is not in equilibrium recoils and stiffens: lower `safety`. The horizon must reach the "
    "neighbours where the spacing is widest, so that graded clouds have large families where it is finest; corrected "
    "weights take long there.",
    "sheet turned": "The law `HyperelasticBonds` knows a direction: take it for sheets that stretch without turning.",
    "a bond turned": "Folds stiffen within a few steps: lower `safety`. Hyperelastic bonds lose their force where they "
    "turn.",
    "compression": "A sheet that is pushed together crumples down to its spacing, as sheets without bending stiffness "
    "do: lower `safety`, add damping, or take `Relaxation` where only the rest state counts. Hyperelastic bonds are "
    "made for tension.",
    "a chain": "Strands a few bonds wide gain energy under laws without a potential: add damping.",
    "zero-energy": "The nodal law does not feel what is finer than a family: a baseline, not for results.",
    "ball": "Any speed: a step is no longer than the ball takes for a quarter of a spacing, so fast balls cost steps.",
    "restart": "Bit for bit.",
    "two runs": "Bit for bit: forces are gathered, nothing is added atomically.",
    "rigid spin": "Rotation by itself costs no energy; the published weights grow from round-off, free and undamped, "
    "and hyperelastic bonds make energy as they turn.",
    "undamped": "Laws without a potential gain or lose energy in the long run: take `plain` or `corrected`. "
    "Viscous sheets only lose.",
}


def limits(cells: Table) -> str:
    """Which laws hold where, one line a group of cases."""
    lines = []
    for begin, advice in ADVICE.items():
        rows = {name: row for name, row in cells.items() if name.startswith(begin)}
        whole, part, failed = [], [], []
        for law in LAWS:
            asked = [name for name, row in rows.items() if law in row and row[law].verdict != NONE]
            good = [name for name in asked if rows[name][law].verdict in (STABLE, SMALLER)]
            shown = law + ("*" if any(rows[name][law].verdict == SMALLER for name in asked) else "")
            if good and len(good) == len(rows):
                whole.append(shown)
            elif good:
                part.append(f"{shown} ({'; '.join(name[len(begin) :].lstrip(' :°,') for name in good)})")
            elif asked:
                failed.append(law)
        said = [f"{how} {', '.join(laws)}" for how, laws in (("with", whole), ("in part with", part)) if laws]
        said += [f"not with {', '.join(failed)}"] if failed else []
        if rows:
            lines.append(f"- **{begin.rstrip(' =')}** holds {'; '.join(said)}. {advice}")
    return "\n".join(lines)


def stands(cells: Table) -> str:
    """Which cells come from where, one line a stamp."""
    lines = []
    for made in dict.fromkeys(c.made for row in cells.values() for c in row.values()):
        rows = [[law for law, c in row.items() if c.made == made] for row in cells.values()]
        counts = {law: sum(law in row for row in rows) for law in LAWS}
        laws = {n: ", ".join(law for law in LAWS if counts[law] == n) for n in sorted({*counts.values()} - {0})}
        seconds = sum(c.seconds for row in cells.values() for c in row.values() if c.made == made)
        lines.append(f"- {made}: {'; '.join(f'cases of {names}: {n}' for n, names in laws.items())}; {seconds:.0f} s.")
    return "\n".join(lines)


def page(cells: Table, numbers: str) -> str:
    """The page as markdown; `numbers` is the name of the file beside it."""
    laws = [law for law in LAWS if any(law in row for row in cells.values())]
    differences = table(cells, laws, lambda c: "" if c.difference is None else shortest(c.difference))
    tried = ", ".join(f"{share:g}" for share in SHARES)
    devices = sorted({c.made.removeprefix("on ").split(",")[0] for row in cells.values() for c in row.values()})
    where = f", {', '.join(devices)}"
    return f"""# Stability on stiff and extreme cases{where}

Made by `tools/stability.py`; the numbers: [{numbers}]({numbers}).

{stands(cells)}

A cell holds a verdict and the number behind it, which the second column names.

- **stable**: at the default share of the estimated step, 0.9.
- **stable with a smaller step**: at the share of the estimate that follows; shares tried are {tried}.
- **diverges cleanly**: the run ends with a message and exit code 3, or the input is refused with one; nothing that is
  not finite is written.
- **wrong**: finite, but it breaks physics: more than {100 * ENERGY_ERROR:g} % error of the energy balance (for a law
  without an energy of its own, k above 1), of 0.1 % in sheets of a few bonds, forces that do not turn with the sheet,
  a value that is not the exact one, modes that nothing resists. An error of the mean stress alone, such as the 2.2 % of
  published weights, is no verdict.
- n/a: the law has no such thing; the remarks say why. An empty cell was not run.

Energy errors are of the balance, over the largest energy or work; for a law without an energy of its own, k marks the
largest kinetic energy over the energy that there can be. `published`, `plain` and `corrected` are weights of the
bond-associated law, horizon {HORIZON}, and `visco` is that law with corrected weights and two Prony terms; the other
laws have their default horizons. `neural` is the network inside a kernel, `visco bonds` the published law
`ViscoBondBased` with the same Prony terms, under tension at rest, `visco series` the same with the update that is
printed, `hyperelastic bonds` the law `HyperelasticBonds` made for equibiaxial stretch, incompressible. Where energy,
not shape, is followed over a long time, the laws without a potential are measured by the nodal energy of the same
displacement, `visco bonds` by its own without what relaxes. Viscous sheets must lose energy: gain marks the largest
rise of theirs from one twentieth of the run to the next, fall of their loss, or drift of energy and loss together,
over the kinetic energy of the start. Their loss must never fall where nothing breaks; where bonds break, the strain
of the others jumps, and the balance judges.

## Limits, and what to do about them

A star marks laws that need a smaller step in some of a group's cases.

{limits(cells)}

## Verdicts, float32

{table(cells, laws, Cell.text)}

## Float32 against float64

Largest difference of what the number is made of (stress, forces, displacement), over the largest; of the number itself
where motion is chaotic.

{differences}

## Remarks

{remarks(cells)}
"""


def main(arguments: Sequence[str] | None = None) -> Table:
    """Run the cases, print a line for each, write the page and the numbers; returns what the page has."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--device", type=device_name, help="by default CUDA where there is one")
    parser.add_argument("--out", type=Path, help="the page; its numbers go beside it, ending in .json")
    parser.add_argument("--missing", action="store_true", help="run only what the numbers do not have yet")
    parser.add_argument("--jobs", type=int, default=1, help="processes that share the work")
    parser.add_argument("--fast", action="store_true", help="fewer cases and shorter runs")
    parser.add_argument("--only", nargs="*", default=[""], help="cases whose name holds one of these")
    parser.add_argument("--laws", nargs="*", choices=list(LAWS), help="by default all; with --fast corrected")
    parser.add_argument("--steps", type=int, default=1_000_000, help="of the oscillation; the spin takes a tenth")
    parser.add_argument("--seconds", type=float, default=10.0, help="after which a long run stops")
    parser.add_argument("--stand", help="name of the commit, where there is no repository")
    given = parser.parse_args(arguments)
    laws = given.laws or (["corrected"] if given.fast else list(LAWS))
    chosen = [c for c in CASES if (c.fast or not given.fast) and any(part in c.name for part in given.only)]
    if not chosen:
        parser.error(f"--only = {given.only}: allowed are parts of the names of cases, such as 'K/mu'")
    if given.jobs < 1:
        parser.error(f"--jobs = {given.jobs}: allowed is 1 or more")
    if given.missing and given.out is None:
        parser.error("--missing: allowed with --out, beside which the numbers are")
    cells: Table = {}
    try:
        device = str(find_device(given.device).name)
        if given.out is not None:
            cells = load(given.out.with_suffix(".json"), device)
    except InputError as error:
        parser.error(str(error))
    for law in laws:
        # A law that cannot be made at all is an error of this tool, not a case that does not apply.
        LAWS[law](RUBBER)
    made = f"{stamp(device, given.stand)}, long runs of up to {given.seconds:g} s{', short' if given.fast else ''}"
    tasks = [
        (case.name, Trial(law, 32, given.device, given.steps, given.seconds, given.fast))
        for case in chosen for law in laws if not (given.missing and law in cells.get(case.name, {}))
    ]  # fmt: skip
    for (name, trial), found in run_all(tasks, given.jobs):
        cells.setdefault(name, {})[trial.law] = replace(found, made=made)
        cells = in_order(cells)
        print(
            f"{name:34s} {trial.law:12s} {found.text():40s} f64 {found.double} diff {found.difference} "
            f"{found.seconds:.1f} s {found.remark[:150]}",
            flush=True,
        )
        if given.out is not None:
            save(given.out, cells)
    if given.out is not None:
        save(given.out, cells)
        print(f"wrote {given.out}")
    return cells


if __name__ == "__main__":
    one_line(main)
