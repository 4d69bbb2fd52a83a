"""What can be told about a run before its first step: notes on its material, sizes, schedules and step."""

from __future__ import annotations

import functools
import math
import operator
from collections.abc import Iterator
from typing import Any

import numpy as np

from ..device.clock import Schedule
from ..interfaces.scales import LIGHTEST, Scales
from ..materials import shear_modulus, stability_notes
from .built import Built
from .scene import Scene
from .scene_context import held_by_loads

# Sizes that rubber sheets do not have: widths [m], thickness over width, shear modulus [Pa].
WIDEST, THICKEST, SOFTEST, STIFFEST = 50.0, 0.5, 10.0, 1e11
# Step over the time in which a wave passes a spacing, below which a note tells the cause.
TINY_STEP = 1e-3
# Passages of waves and steps from which a run is said to be slow.
MANY_PASSAGES, MANY_STEPS = 300.0, 20_000


def foreseen(built: Built) -> list[str]:
    """Notes on a scene, one line each."""
    scene = built.simulation
    material: Any = getattr(scene.force, "material", None)
    continuum = hasattr(material, "functions") and hasattr(material, "constants")
    notes = stability_notes(material) if continuum else []
    unlikely = list(_unlikely_sizes(built, shear_modulus(material) if continuum else None))
    sizes = [f"sizes: {'; '.join(unlikely)}"] if unlikely else []
    return [*notes, *sizes, *_unheld(built), *_held_forces(scene), *dict.fromkeys(_never_reached(built))]


def step_note(built: Built, dt: float) -> str:
    """A note on a step [s] that is far shorter than that of waves, or than what the run is about; or ""."""
    material: Any = getattr(built.simulation.force, "material", None)
    if not built.simulation.solver.dynamic or not built.solver.has_inertia or not hasattr(material, "functions"):
        return ""
    sheet = built.context.whole
    finest = sheet.spacing if sheet.spacings is None else float(sheet.spacings.min())
    wave = finest * math.sqrt(float(np.mean(sheet.density)) / (4.0 * shear_modulus(material)))
    if not 0.0 < dt < TINY_STEP * wave:
        return _other_solver(built, dt, wave / finest * float(np.ptp(sheet.points, axis=0).max()), wave)
    cause = built.solver.cause_of_step(dt)
    light = float(np.min(sheet.density)) / float(np.mean(sheet.density))
    if not cause:
        cause = "its density varies much" if light < 0.01 else "its stiffness or thickness varies much"
    return f"step: {dt:.3g} s is {wave / dt:.3g} times shorter than a wave takes from point to point: {cause}"


def _other_solver(built: Built, dt: float, passage: float, wave: float) -> str:
    """A note on a solver that is faster by far, or "".

    Args:
        built: The simulation.
        dt: Its step [s].
        passage: Time in which a wave passes the sheet [s].
        wave: Time in which it passes a spacing [s].
    """
    scene = built.simulation
    duration, explicit = scene.solver.duration, scene.solver.steps_explicitly
    if explicit and duration > MANY_PASSAGES * passage and duration > MANY_STEPS * dt:
        if scene.damage is None and not scene.contacts and not scene.sheet.inclusions:
            return (
                f"step: {count_text(duration / dt)} steps of {dt:.3g} s follow waves, which pass the sheet in "
                f"{passage:.2g} s; the run takes {duration:g} s: Implicit({duration:g}, tolerance=1e-4) follows what "
                "is slow"
            )
    if not explicit and dt < wave and not adapts_steps(scene.solver):
        return f"step: {dt:.3g} s is shorter than a wave takes from point to point, {wave:.2g} s: Explicit is faster"
    return ""


def adapts_steps(solver: Any) -> bool:
    """Whether a solver in time adapts its steps to a tolerance, so that their number is not known before."""
    return getattr(solver, "tolerance", None) is not None


def count_text(number: float) -> str:
    """A large number for people, such as "12 000" or "4.9e+07"."""
    return f"{number:,.0f}".replace(",", " ") if number < 1e7 else f"{number:.2g}"


def _unlikely_sizes(built: Built, modulus: float | None) -> Iterator[str]:
    """Sizes of a scene that cannot be meant, each with the likely unit."""
    scene, sheet = built.simulation, built.context.whole
    width, thickness = float(np.ptp(sheet.points, axis=0).max()), float(np.mean(sheet.thickness))
    if width > WIDEST:
        yield f"the sheet is {width:.3g} m wide; are its points in mm? Lengths are in m"
    if thickness > THICKEST * width:
        yield f"the sheet is {thickness:.3g} m thick and {width:.3g} m wide; is the thickness in mm? Lengths are in m"
    density = float(np.mean(sheet.density))
    # Larger ones may be chosen for longer steps.
    if scene.solver.dynamic and density < LIGHTEST:
        yield f"the density is {density:.3g} kg/m^3; is it in g/cm^3? Rubber has about 1000 kg/m^3"
    if modulus is not None and not SOFTEST <= modulus <= STIFFEST:
        meant = "MPa" if modulus < SOFTEST else "another unit"
        yield f"the shear modulus is {modulus:.3g} Pa; are the constants in {meant}? Rubber has 1e5 to 1e6 Pa"
        modulus = None
    scales = Scales.of(sheet, modulus, scene.solver.dynamic)
    for part in (*scene.loads, *scene.contacts):
        yield from part.doubts(sheet, scales)
    for name, of in (("initial_displacement", scales.of_length), ("initial_velocity", scales.of_speed)):
        if getattr(scene, name) is not None:
            yield from of(f"{name} reaches", float(np.linalg.norm(scene.initial(name), axis=1).max()))


def _unheld(built: Built) -> Iterator[str]:
    """Directions in which no support holds a sheet in static equilibrium."""
    held = functools.reduce(operator.or_, (c.components for c in built.constraints if len(c.points)), 0)
    free = [axis for bit, axis in enumerate("xyz") if not held & (1 << bit)]
    if free and not built.simulation.solver.dynamic and not built.context.whole.inclusions:
        yield (
            f"supports: none holds the sheet along {' and '.join(free)}: expected Fixed or Motion, unless loads that "
            "follow the sheet or bodies hold it"
        )


def _held_forces(scene: Scene) -> Iterator[str]:
    """Point forces that act on supports alone."""
    forces: list[Any] = [load for load in scene.loads if hasattr(load, "forces")]
    if not forces:
        return
    held = held_by_loads(scene)
    for load in forces:
        points, force = load.forces(scene.sheet)
        bits = held[points][:, None] >> np.arange(3) & 1
        if force.any() and bits[force != 0.0].all():
            yield f"{type(load).__name__} {tuple(load.value)} N: supports hold all of its points, and it moves nothing"


def _never_reached(built: Built) -> Iterator[str]:
    """Schedules that change after the end of the run."""
    scene = built.simulation
    end = scene.solver.duration
    for schedule in _schedules(built):
        if schedule.name and schedule.changes_after(end):
            yield _beyond(scene, schedule.name, float(schedule.times[-1]), end)
    for contact in scene.contacts:
        motion = getattr(contact, "motion", None)
        times = getattr(motion, "times", None)
        if times is not None and np.max(times) > end * (1.0 + 1e-9):
            yield _beyond(scene, type(motion).__name__, float(np.max(times)), end)


def _schedules(built: Built) -> Iterator[Schedule]:
    yield from built.context.clock.schedules
    for constraint in built.constraints:
        if constraint.motion is not None:
            yield constraint.motion
        if constraint.turn is not None:
            yield constraint.turn.angle


def _beyond(scene: Scene, name: str, last: float, end: float) -> str:
    if scene.solver.dynamic:
        return f"{name}: it changes until {last:.6g} s, and the run ends at {end:.6g} s"
    solver = type(scene.solver).__name__
    return (
        f"{name}: it changes until {last:.6g} s, and {solver} ends at the load time {end:.6g} s: expected times up to "
        f"that, or {solver}(duration={last:.6g})"
    )
