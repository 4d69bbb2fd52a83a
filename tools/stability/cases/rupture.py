"""Cases of rupture and contact: a ball, all bonds at once, a restarted and a repeated tear."""

from __future__ import annotations

import tempfile
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from warp_pd import CriticalStretch, Explicit, Fixed, RigidBall, Simulation
from warp_pd.interfaces import FrameReport, FrameSink, Reporter
from warp_pd.run.runner import DIVERGED, STOPPED

from ..laws import DENSITY, RUBBER, THICKNESS, Trial
from ..motion import begin, square, stretched, volume
from ..runs import SHARES, verdict_of_run
from ..verdicts import NONE, SMALLER, STABLE, WRONG, Finding

# Frames of the runs that are restarted and repeated; each has a restart file.
FRAMES = 40


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
    """The run must end and balance its energy, and the ball must touch all points in its way."""

    def find(trial: Trial) -> Finding:
        found = Finding(NONE)
        for share in SHARES:
            simulation = ball_scene(trial, speed, share)
            # Four times what the ball gives to the mass in its way.
            budget = 4.0 * DENSITY * THICKNESS * np.pi * 0.15**2 * (2.0 * speed) ** 2
            found = verdict_of_run(trial, simulation, budget)
            missed = missed_points(trial, simulation) if found.verdict == STABLE else None
            if missed is not None:
                found = replace(found, verdict=WRONG, remark=missed)
            found = replace(found, field=None)
            if found.verdict == STABLE:
                return found if share == SHARES[0] else replace(found, verdict=SMALLER, remark=f"at {share:g}")
        return replace(found, remark=f"at {SHARES[-1]:g}: {found.remark}")

    return find


class NoFrames(FrameSink):
    """Records nothing, so that what the ball gives each point adds up over the whole run."""

    def __init__(self) -> None:
        self.frame_index, self.time, self.steps = 0, 0.0, 0
        self.stable_dt, self.residual, self.solve = None, None, None


def missed_points(trial: Trial, simulation: Simulation) -> str | None:
    """What is wrong if the ball passed points in its way without touching them, or None."""
    built: Any = simulation.build(trial.device, trial.bits)
    built.context.compile()
    begin(built)
    built.solver.run(NoFrames())
    under = np.hypot(*(simulation.sheet.points - 0.5).T) < 0.1
    missed = int((built.to_numpy(built.contact.impulse)[under] == 0.0).all(axis=1).sum())
    return f"the ball did not touch {missed} of the {int(under.sum())} points in its way" if missed else None


def break_all(trial: Trial) -> Finding:
    """Every bond breaks in the first step: all energy is released, all points fly free."""
    sheet = square()
    velocity = 0.1 * np.random.default_rng(3).normal(size=(sheet.size, 3))
    budget = RUBBER.energy(1.6, 1.6) * volume(sheet)
    simulation = trial.simulation(
        sheet, initial_displacement=stretched(sheet, 1.6, 1.6), initial_velocity=velocity, damage=CriticalStretch(1.3),
        solver=Explicit(0.2, frames=20),
    )  # fmt: skip
    found = verdict_of_run(trial, simulation, budget)
    if found.verdict != STABLE:
        return found
    result = simulation.run(device=trial.device, precision=trial.bits)
    if result.history[-1]["mean_damage"] < 1.0:
        return Finding(WRONG, found.number, "some bonds are intact")
    return found


class StopAt(Reporter):
    """Stops a run after one of its frames, when its restart file has been written."""

    def __init__(self, index: int) -> None:
        self.index = index

    def frame(self, report: FrameReport) -> None:
        """Stop the run if this is the frame."""
        if round(report.fraction * report.frames) >= self.index:
            raise KeyboardInterrupt


def restart_arrays(folder: Path) -> dict[str, np.ndarray]:
    """Arrays of the points and bonds in a restart file."""
    with np.load(folder / "restart.npz") as stored:
        return {name: stored[name] for name in stored.files if name != "numbers"}


def differing_bytes(one: dict[str, np.ndarray], two: dict[str, np.ndarray]) -> int:
    """Number of bytes that differ."""
    return sum(int((a.view(np.uint8) != two[name].view(np.uint8)).sum()) for name, a in one.items())


def restart_run(trial: Trial) -> Finding:
    """A run stopped in the middle of a tear and resumed, against an uninterrupted one: bytes that differ."""
    options: dict[str, Any] = {"device": trial.device, "precision": trial.bits, "usd": False, "pictures": False}
    with tempfile.TemporaryDirectory() as name:
        whole, parts = Path(name) / "whole", Path(name) / "parts"
        full = ball_scene(trial, 1.0, 0.2, FRAMES).run(out=whole, **options)
        damage = [row["mean_damage"] for row in full.history]
        if full.status == DIVERGED or not damage[-1] > 0.0:
            return Finding(NONE, None, f"the tear {full.status}: {full.summary['message']}")
        middle = int(np.flatnonzero(np.array(damage) > 0.5 * damage[-1])[0])
        first = ball_scene(trial, 1.0, 0.2, FRAMES).run(out=parts, reporter=StopAt(middle), **options)
        second = ball_scene(trial, 1.0, 0.2, FRAMES).run(out=parts, resume=True, **options)
        if first.status != STOPPED or second.status != full.status:
            return Finding(WRONG, None, f"{first.status}, then {second.status}")
        found = differing_bytes(restart_arrays(whole), restart_arrays(parts))
    return Finding(STABLE if found == 0 else WRONG, float(found), f"stopped at frame {middle} of {len(damage) - 1}")


def repeat_run(trial: Trial) -> Finding:
    """The same tear twice on the same device: bytes of displacement and velocity that differ."""
    frames = [
        ball_scene(trial, 1.0, 0.2, FRAMES).run(device=trial.device, precision=trial.bits).frame for _ in range(2)
    ]
    one, two = ({"u": f.displacement, "v": f.velocity} for f in frames)
    found = differing_bytes(one, two)
    return Finding(STABLE if found == 0 else WRONG, float(found))
