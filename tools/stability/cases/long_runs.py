"""Cases of long runs: an undamped oscillation, and a rigid spin."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from time import perf_counter

import numpy as np

from warp_pd import Built, Explicit, Fixed, Nodal, Simulation, ViscoBondBased
from warp_pd.interfaces import Law

from ..laws import RUBBER, Trial
from ..motion import begin, energies, estimated_step, put, smooth, square, stretched, viscous_loss, why_diverged
from ..verdicts import CLEAN, GAIN, STABLE, WRONG, Finding, NotApplicableError, step_count


@dataclass(frozen=True)
class Samples:
    """Energies along a long run [J].

    Attributes:
        kinetic: Kinetic energy.
        strain: Stored energy plus viscous loss.
        lost: Viscous loss.
        steps: Steps taken.
    """

    kinetic: np.ndarray
    strain: np.ndarray
    lost: np.ndarray
    steps: int


def long_run(trial: Trial, built: Built, dt: float, steps: int, stored: Callable[[], float]) -> Samples:
    """Take steps in two hundred parts, or as many as the time allows; `stored` gives the stored energy [J]."""
    assert built.state.step is not None
    built.context.run("setup")
    built.state.step.fill_(dt)
    part = max(10, steps // 200)
    many = built.context.sequence("step", repeat=min(part, 1000))
    rounds = max(1, part // min(part, 1000))
    kinetic, strain, lost, done = [energies(built)[0]], [stored()], [viscous_loss(built)], 0
    start = perf_counter()
    while done < steps and perf_counter() - start < trial.seconds:
        for _ in range(rounds):
            many.run()
        done += rounds * many.repeat
        kinetic.append(energies(built)[0])
        strain.append(stored())
        lost.append(viscous_loss(built))
        if why_diverged(built, np.array(kinetic) + np.array(strain), dt):
            break
    return Samples(np.array(kinetic), np.array(strain), np.array(lost), done)


def stored_energy(trial: Trial, built: Built) -> Callable[[], float]:
    """What gives the stored energy plus viscous loss [J].

    For a law without an energy it is that of another law at the same displacement: of ViscoBondBased without its Prony
    terms, or else of the nodal law.
    """
    if built.law.strain_energy is not None:
        return lambda: energies(built)[1]
    own = built.simulation.force
    law: Law = replace(own, prony=()) if isinstance(own, ViscoBondBased) else Nodal(RUBBER.material)
    other = Simulation(built.simulation.sheet, law, Explicit(1.0)).build(trial.device, trial.bits)
    other.context.compile()

    def stored() -> float:
        put(other, built.state.displacement.numpy())
        return energies(other)[1]

    return stored


def oscillation(trial: Trial) -> Finding:
    """Undamped, for a million steps: drift of the energy over the kinetic energy of the start."""
    sheet = square(5)
    velocity = 2.0 * smooth(sheet, 0.1)
    built = trial.built(
        sheet, loads=[Fixed(sheet.edges("all"))], initial_displacement=stretched(sheet, 1.1, 1.1),
        initial_velocity=velocity,
    )  # fmt: skip
    begin(built)
    stored = stored_energy(trial, built)
    dt = 0.2 * estimated_step(built)
    s = long_run(trial, built, dt, 2000 if trial.short else trial.steps, stored)
    total = s.kinetic + s.strain
    quarter = max(1, len(total) // 4)
    if why := why_diverged(built, total, dt):
        return Finding(CLEAN, None, f"a run ends with a message: {why} within {step_count(s.steps)}")
    # In the first quarter the energy spreads over the modes, on which the energy of central differences depends.
    drift = float((total[-quarter:].mean() - total[quarter : 2 * quarter].mean()) / s.kinetic[0])
    if getattr(built.law, "internal", None):
        number = gain_of(total - s.lost, s.lost) / s.kinetic[0]
        number = max(number, abs(drift)) if built.law.has_energy else number
        left = (total - s.lost)[-quarter:].mean() / (total - s.lost)[0]
        remark = f"{100.0 * left:.3g} % of the energy is left, {step_count(s.steps)}"
        return Finding(STABLE if number < 0.05 and left < 1.0 else WRONG, number, remark, unit=GAIN)
    return Finding(STABLE if abs(drift) < 0.05 else WRONG, drift, step_count(s.steps))


def gain_of(energy: np.ndarray, lost: np.ndarray) -> float:
    """Largest rise of a viscous sheet's energy from one twentieth of the run to the next, or fall of its loss [J]."""
    parts = np.array([part.mean() for part in np.array_split(energy, min(20, len(energy)))])
    return float(max(np.diff(parts).max(initial=0.0), -np.diff(lost).min(initial=0.0)))


def spin(trial: Trial) -> Finding:
    """A free sheet spins about a slanted axis: drift of its energy or angular momentum, relative to the start."""
    sheet = square(5)
    place = np.column_stack([sheet.points - sheet.points.mean(axis=0), np.zeros(sheet.size)])
    rate = np.array([0.2, 0.1, 0.3])
    if isinstance(trial.simulation(sheet).force, ViscoBondBased):
        raise NotApplicableError("the law has a prestress: a free sheet contracts and has no shape to keep")
    built = trial.built(sheet, initial_velocity=np.cross(rate, place))
    stored = stored_energy(trial, built)
    mass = built.to_numpy(built.state.mass)[:, None]

    def angular_momentum() -> np.ndarray:
        now = place + built.to_numpy(built.state.displacement)
        return (mass * np.cross(now, built.to_numpy(built.state.velocity))).sum(axis=0)

    before = angular_momentum()
    dt = 0.5 * estimated_step(built)
    s = long_run(trial, built, dt, 2000 if trial.short else max(2000, trial.steps // 10), stored)
    total = s.kinetic + s.strain
    if why := why_diverged(built, total, dt):
        return Finding(CLEAN, None, f"a run ends with a message: {why} within {step_count(s.steps)}")
    change = float(np.linalg.norm(angular_momentum() - before) / np.linalg.norm(before))
    drift = float(np.abs(total / total[0] - 1.0).max())
    turns = np.linalg.norm(rate) * dt * s.steps / (2.0 * np.pi)
    number = max(change, drift)
    remark = f"{'momentum' if change > drift else 'energy'}, {step_count(s.steps)}, {turns:.3g} turns"
    return Finding(STABLE if number < 0.02 else WRONG, number, remark)
