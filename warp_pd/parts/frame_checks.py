"""Parts that every run has: the clock, and what is computed at frames (soundness, energies, sums of the history)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np
import warp as wp

from ..context import Context
from ..device.cores import begin_loading
from ..device.fields import Array
from ..device.graph import run_once
from ..device.launches import Stage
from ..families.partition import Partition
from ..geometry.sheet import Sheet
from ..interfaces import BuiltLaw, BuiltPart, Columns
from ..kernels.block_sums import BLOCK, frame_checks
from ..kernels.integrate import clock, kinetic_energy
from ..step import Phase


class Ticking(BuiltPart):
    """Advances the time between the motions and the loads of a step, and evaluates the schedules."""

    def __init__(self, context: Context) -> None:
        self.context = context

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launch of the clock, unless a body on a path counts the time."""
        if phase is Phase.CLOCK and self.context.dynamic and self.context.clock.counted_by is not None:
            return
        if phase in (Phase.CLOCK, Phase.SCHEDULES):
            self.context.clock.add_tick(stage, steps=1 if phase is Phase.CLOCK else 0)


OWNER = "frames"


def begin_loading_common(context: Context) -> None:
    """Begin to compile or load kernels that every run has, one in each of two threads, beside the set-up of the rest.

    The threads that compile on a CPU have then read Warp's header when the other kernels follow. The compiler of a GPU
    reads it once for all threads.
    """
    if context.device.is_cpu:
        for common in (frame_checks(context.bits).watch_motion, clock(context.bits)):
            begin_loading(common.kernel, context.device)


class FrameChecks(BuiltPart):
    """Kinetic energy, largest speed, and a check for NaN and infinite values, at every frame.

    Attributes:
        not_finite: Lowest index of a NaN or infinite point in each block of points; the number of points if all are
            finite.
        fastest: Largest squared speed in each block of points [m^2/s^2].
        kinetic_energy: Kinetic energy of each point [J], (N,) float64.
        half_step_kinetic: Kinetic energy of each point [J] from the velocities half a step before and after, for the
            energy balance; None without a balance.
    """

    def __init__(self, context: Context, inertia: bool = True) -> None:
        """Allocate the arrays; without inertia there is no kinetic energy."""
        self.context, self._inertia = context, inertia
        self._blocks = context.own_blocks
        self.kinetic_energy = context.array("kinetic_energy", OWNER, wp.float64, shape=context.sheet.size)
        self.half_step_kinetic: Array | None = None
        if context.options.tracked:
            self.half_step_kinetic = context.array("half_step_kinetic", OWNER, wp.float64, shape=context.sheet.size)
        self.not_finite = context.array("not_finite", OWNER, wp.int32, shape=self._blocks, per="block")
        self.fastest = context.array("fastest", OWNER, wp.float64, shape=self._blocks, per="block")

    def add(self, phase: Phase, stage: Stage) -> None:
        """Add the launches of the kinetic energy and the motion checks."""
        if phase is not Phase.FRAME:
            return
        context, state = self.context, self.context.state
        if self._inertia:
            stage.launch(
                OWNER, kinetic_energy(context.options), context.sheet.size,
                mass=state.mass, held_mask=state.held_mask, velocity=state.velocity, step=state.step,
                damping=state.damping, force=state.force, external=state.external, out=self.kinetic_energy,
                half_step=self.half_step_kinetic,
            )  # fmt: skip
        context.launch_on_blocks(
            stage, OWNER, frame_checks(context.bits).watch_motion,
            {"displacement": state.displacement, "velocity": state.velocity},
            {"not_finite": self.not_finite, "fastest": self.fastest},
        )  # fmt: skip

    def columns(self) -> Columns:
        """The kinetic energy, and that of the energy balance."""
        sums = {} if self.half_step_kinetic is None else {"half_step_kinetic": self.half_step_kinetic}
        return Columns(sums=sums, stored={"kinetic": self.kinetic_energy})

    def first_not_finite(self) -> int | None:
        """Index of the first point whose displacement or velocity was NaN or Inf at the last frame, or None."""
        lowest, partition = self.context.whole_array(self.not_finite), self.context.partition
        first = int((lowest if partition is None else self._in_whole(lowest, partition)).min())
        return None if first == self.context.whole.size else first

    def _in_whole(self, lowest: np.ndarray, partition: Partition) -> np.ndarray:
        """Convert local indices of points, one per block, to indices in the whole sheet (its size for none)."""
        begins = BLOCK * np.arange(len(lowest))
        found = lowest + partition.bounds[partition.block_owner_of(begins)]
        return np.where(found < begins + BLOCK, found, self.context.whole.size)

    def top_speed(self) -> float:
        """Largest speed at the last frame [m/s]."""
        return float(np.sqrt(self.context.whole_array(self.fastest).max()))


class EnergyBalance:
    """Energies, work and losses in the history, and the error of their balance.

    Attributes:
        work: External work of each point [J], (N,) float64, or None.
        dissipated: Energy dissipated by damping at each point [J], (N,) float64, or None.
        balances: Whether work and losses are tracked, the law has an energy and all parts are balanced, so that there
            is a balance.
        stored: Names of the energies that the parts store.
        lost: Names of the energies that the parts lose.
    """

    def __init__(self, context: Context, law: BuiltLaw, does_work: bool, unbalanced: bool) -> None:
        options, n = context.options, context.sheet.size
        self.work: Array | None = None
        self.dissipated: Array | None = None
        if options.tracked and does_work:
            self.work = context.array("work", "energy balance", wp.float64, shape=n, restart=True)
        if options.tracked and options.damped:
            self.dissipated = context.array("dissipated", "energy balance", wp.float64, shape=n, restart=True)
        self.balances = options.tracked and law.has_energy and not unbalanced
        # These columns are 0 in scenes that have no such work or loss, so that runs can be compared.
        self._always: tuple[str, ...] = ("external", "damping") if options.tracked else ()
        self._always += ("rupture",) if options.tracked and law.has_energy else ()
        self.stored: Sequence[str] = ()
        self.lost: Sequence[str] = ()

    def count(self, parts: Iterable[BuiltPart]) -> tuple[Columns, ...]:
        """Count the energies that these parts store and lose; return what they and the balance add to the history."""
        sums = {} if self.work is None else {"external": self.work}
        own = Columns(sums=sums, lost={} if self.dissipated is None else {"damping": self.dissipated})
        of_parts = [part.columns() for part in parts]
        self.stored = [name for columns in of_parts for name in columns.stored]
        self.lost = [name for columns in (*of_parts, own) for name in columns.lost]
        names = tuple(dict.fromkeys((*self.stored, "half_step_kinetic", *self._always, *self.lost, "balance_error")))

        def row(totals: Mapping[str, float], elapsed: float) -> dict[str, float]:
            return {name: totals.get(name, 0.0) for name in names if name in totals or name in self._always}

        units = {**dict.fromkeys(names, "J"), "balance_error": "1"}
        own = replace(
            own, names=names, at_frame=row, between=lambda _, totals, elapsed: row(totals, elapsed), units=units
        )
        return (own, *of_parts)

    def error(self, history: Sequence[Mapping[str, float]], row: Mapping[str, float], least: float = 0.0) -> float:
        """Energy gained since the first row, less the work, over the largest energy or work so far.

        `least` is the least energy to divide by [J].
        """
        if not history:
            return 0.0
        scale = max(self._largest(history), least)
        gained = history[-1]["balance_error"] * scale + self._gained(history[-1], row)
        scale = max(self._largest([row]), scale)
        return gained / scale if scale > 0.0 else 0.0

    def gain(self, history: Sequence[Mapping[str, float]], row: Mapping[str, float], least: float = 0.0) -> float:
        """The same since the last row."""
        scale = max(self._largest([*history, row]), least)
        return self._gained(history[-1], row) / scale if history and scale > 0.0 else 0.0

    def _gained(self, before: Mapping[str, float], row: Mapping[str, float]) -> float:
        """Changes of the stored energies and of the losses between two rows, less the work [J].

        See kernels/integrate.py for the kinetic energy at half steps. What it lacks goes with the square of the step,
        and may be all energy of motion from point to point at the highest frequency: both rows have it at one step.
        """
        before = _at_step(before, row["step"])
        counted = ["half_step_kinetic" if name == "kinetic" else name for name in (*self.stored, *self.lost)]
        return sum(row[name] - before[name] for name in counted) - (row["external"] - before["external"])

    def _largest(self, rows: Sequence[Mapping[str, float]]) -> float:
        """Largest energy or work of some rows [J]."""
        return max(max(abs(row["external"]), abs(sum(row[name] for name in self.stored))) for row in rows)


def placing_noise(sheet: Sheet, given: np.ndarray, bits: int) -> float:
    """Energy [J] times step squared that round-off of an initial displacement [m], (N, 3), can add in a step.

    No frequency exceeds 2 / dt. This is all the energy of a sheet that was placed and waits.
    """
    mass = float((sheet.areas * sheet.thickness * sheet.density).sum())
    apart = float(np.abs(given).max() * np.finfo(f"f{bits // 8}").eps)
    return 2.0 * mass * apart**2


def _at_step(row: Mapping[str, float], step: float) -> Mapping[str, float]:
    """A row whose kinetic energy at half steps is that of a step of another length [s]."""
    if row["step"] == step or row["step"] == 0.0:
        return row
    lacking = (row["kinetic"] - row["half_step_kinetic"]) * (step / row["step"]) ** 2
    return {**row, "half_step_kinetic": row["kinetic"] - lacking}


class Sums:
    """Sums of arrays over all points at frames: blocks are summed in order on the device, the rest on the host."""

    def __init__(self, context: Context, columns: Iterable[Columns]) -> None:
        """Collect the arrays to sum. Raises ValueError if two parts use the same name for a sum."""
        self.context = context
        self.arrays: dict[str, Array] = {}
        for of_part in columns:
            for name, array in (*of_part.sums.items(), *of_part.stored.items(), *of_part.lost.items()):
                if name in self.arrays:
                    raise ValueError(f"sums: two parts use the name {name!r}; expected different names")
                self.arrays[name] = array
        self._rows: list[str] = []
        for name, array in self.arrays.items():
            self._rows += [name] if array.dtype is wp.float64 else [f"{name}_{c}" for c in "xyz"]
        shape = (len(self._rows), context.own_blocks)
        self._gathering: Stage | None = None
        self._sums = self._all = context.array("sums_of_blocks", OWNER, wp.float64, shape=shape, per="block")

    def add(self, stage: Stage) -> None:
        """Add the launches of the sums, which must follow those that fill the arrays."""
        checks, row = frame_checks(self.context.bits), 0
        for values in self.arrays.values():
            scalar = values.dtype is wp.float64
            kernel = checks.sum_blocks if scalar else checks.sum_vectors
            self.context.launch_on_blocks(stage, OWNER, kernel, {"values": values}, {"sums": self._sums}, row=row)
            row += 1 if scalar else 3

    def totals(self, kept: Array | None = None) -> dict[str, float]:
        """Sums by name, of the last frame or of `kept`, a result of `keep`."""
        sums = self.context.whole_array(self._sums) if kept is None else kept.numpy()
        return dict(zip(self._rows, sums.sum(axis=1).tolist(), strict=True))

    def keep(self) -> Array:
        """A copy, on the device, of the sums over the whole sheet; the host does not wait for it."""
        stage = self._gathering
        if stage is None:
            context = self.context
            stage = self._gathering = Stage("sums", "", context.device, context.block_dim, [])
            self._all = context.all_blocks(stage, self._sums, "sums_of_all_blocks", OWNER)
        run_once(self.context.device, stage)
        kept: Array = wp.clone(self._all)
        return kept
