"""A run of each solver that is stopped at its frames and resumed ends with the bits of the run that never stopped."""

import numpy as np
import pytest
from helpers import GENT, NEO, jittered, square
from point_laws import tiny
from resumed_runs import require_same_when_stopped
from visco_laws import LAWS as VISCOUS

from warp_pd import (
    ArcLength,
    Bimodular,
    BondAssociated,
    BondBased,
    BoundaryForce,
    CriticalEnergy,
    CriticalStretch,
    Explicit,
    Fixed,
    Motion,
    Neural,
    Newton,
    Nodal,
    PointForce,
    Pressure,
    Relaxation,
    RigidBall,
    Simulation,
    Yeoh,
)

RISING = [(0.0, 0.0), (1.0, 1.0)]


def scene(sheet, solver, force=None, **parts):
    return Simulation(sheet, force or BondAssociated(NEO, horizon=2.015, weights="plain"), solver, **parts)


def held(sheet, *loads):
    return [Fixed(sheet.edges()), *loads]


def pulled(sheet, along=0.05, last=1.0):
    motion = Motion(sheet.edges("right"), [0.0, last], x=[0.0, along], y=0.0, z=0.0)
    return [Fixed(sheet.edges("left")), motion]


def torn_strip(solver, stretch, along, force=None):
    """A notched strip that is pulled until it tears."""
    sheet = square(13).cut((-0.01, 0.051), (0.03, 0.051))
    motion = Motion(sheet.edges("top"), [0.0, 1.0], x=0.0, y=[0.0, along], z=0.0)
    return scene(sheet, solver, force, loads=[Fixed(sheet.edges("bottom")), motion], damage=CriticalStretch(stretch))


def flying_apart(law):
    """A viscous sheet that tears."""
    sheet = square(7)
    return scene(
        sheet, Explicit(2e-3, frames=6, safety=0.5), law, loads=[Fixed(sheet.edges("left"))],
        initial_velocity=300.0 * sheet.positions * [1.0, 0.0, 0.0], damage=CriticalEnergy(20.0),
    )  # fmt: skip


RELAXED = {
    "pressure": lambda: scene(
        square(9), Relaxation(load_steps=4), loads=held(square(9), Pressure(5.0, ramp=RISING))
    ),
    "pull and dead load": lambda: scene(
        square(9), Relaxation(load_steps=4, ramp_steps=100, tolerance=1e-5),
        loads=[*pulled(square(9)), PointForce([40], (0.0, 0.0, 0.01), ramp=RISING)],
    ),
    "rupture": lambda: torn_strip(
        Relaxation(tolerance=1e-5, load_steps=4, ramp_steps=100, most_steps=20_000), 1.6, 0.08
    ),
    "nodal": lambda: scene(
        square(9), Relaxation(load_steps=3, ramp_steps=100, tolerance=1e-4), Nodal(NEO), loads=pulled(square(9), 0.01)
    ),
}  # fmt: skip
SOLVED = {
    "pressure, direct": lambda: scene(square(9), Newton(load_steps=5), loads=held(square(9), Pressure(5.0))),
    "pull, multigrid": lambda: scene(
        square(21), Newton(load_steps=4, preconditioner="multigrid"),
        loads=[*pulled(square(21)), Pressure(2.0, ramp=RISING)],
    ),
    "path past a limit point": lambda: scene(
        square(7), ArcLength(increment=0.2, most_steps=10), BondAssociated(Yeoh(c10=500.0, c30=0.05), horizon=2.015),
        loads=held(square(7), Pressure(60.0)),
    ),
    "path, multigrid": lambda: scene(
        square(21), ArcLength(most_steps=3, preconditioner="multigrid"),
        loads=held(square(21), Pressure(5.0, follower=False)),
    ),
    "bond-based, rupture": lambda: torn_strip(
        Newton(load_steps=4, most_iterations=60), 1.06, 0.004, BondBased(Bimodular(3e3))
    ),
}  # fmt: skip
PRECONDITIONERS = {"path, multigrid": "multigrid", "pressure, jacobi": "jacobi", "pull, multigrid": "multigrid"}
STEPPED = {
    "ball and rupture": lambda: scene(
        square(13), Explicit(0.06, frames=4, damping=1.0), loads=held(square(13)), damage=CriticalStretch(1.05),
        contact=RigidBall(0.03, (0.05, 0.05, 0.0151), (0.0, 0.0, -1.0)),
    ),
    "pull, ramp, boundary force": lambda: scene(
        square(9), Explicit(0.02, frames=4),
        loads=[*pulled(square(9), 0.02, 0.02), Pressure(5.0, ramp=[(0.0, 0.0), (0.02, 1.0)]), BoundaryForce(1e9)],
    ),
    "rigid inclusion": lambda: scene(
        square(13).inclusion((0.05, 0.05), 0.018), Explicit(0.05, frames=4),
        loads=pulled(square(13).inclusion((0.05, 0.05), 0.018), 0.02, 0.05),
    ),
    "cloud, free, no energy": lambda: scene(
        jittered(9), Explicit(0.02, frames=4, damping=3.0), track_energy=False,
        initial_velocity=0.1 * np.random.default_rng(0).normal(size=(81, 3)),
    ),
    "torch": lambda: scene(
        square(9), Explicit(0.02, frames=4), Neural(NEO, network=tiny()), loads=held(square(9), Pressure(5.0))
    ),
    "visco": lambda: flying_apart(VISCOUS["stress-free"]),
    "visco bonds": lambda: flying_apart(VISCOUS["published"]),
}  # fmt: skip


def stops(simulation):
    """Frames after each restart file; the first one holds the start alone."""
    return list(range(1, simulation().solver.frame_count + 1))


def require_damage(case, result):
    """In a case with rupture bonds broke before the last restart file, and after it."""
    damage = [row.get("mean_damage") for row in result.history]
    if "rupture" in case:
        assert 0.0 < damage[-2] < damage[-1]
    if "visco" in case:
        assert damage[-1] > 0.0


@pytest.mark.parametrize("case", RELAXED)
def test_relaxation_goes_on_bit_for_bit(case, tmp_path):
    result = require_same_when_stopped(RELAXED[case], tmp_path, stops(RELAXED[case]), 64)
    assert np.abs(result.frame.displacement).max() > 1e-4
    require_damage(case, result)


@pytest.mark.parametrize("case", SOLVED)
def test_newton_goes_on_bit_for_bit(case, tmp_path):
    result = require_same_when_stopped(SOLVED[case], tmp_path, stops(SOLVED[case]), 64)
    assert np.abs(result.frame.displacement).max() > 1e-4
    assert result.summary["solve"]["preconditioner"] == PRECONDITIONERS.get(case, "direct")
    require_damage(case, result)


@pytest.mark.parametrize("case", STEPPED)
def test_explicit_dynamics_go_on_bit_for_bit(case, tmp_path):
    result = require_same_when_stopped(STEPPED[case], tmp_path, stops(STEPPED[case]), 64)
    assert np.abs(result.frame.displacement).max() > 1e-5
    require_damage(case, result)


SINGLE = {
    "relaxation": RELAXED["pressure"],
    "newton": SOLVED["bond-based, rupture"],
    "explicit": STEPPED["ball and rupture"],
}


@pytest.mark.parametrize("solver", SINGLE)
def test_float32_goes_on_bit_for_bit(solver, device, tmp_path):
    require_same_when_stopped(SINGLE[solver], tmp_path, [2], 32, device=device)


def near_the_lock(points, along, **settings):
    law = BondAssociated(type(GENT)(mu=1e3, bulk=2e5, lock=1.0), horizon=2.015, weights="plain")
    return scene(square(points), Newton(**settings), law, loads=pulled(square(points), along))


def cutbacks(result):
    return [step["share"] for step in result.summary["solve"]["load_steps"] if not step["converged"]]


def test_cutbacks_go_on_bit_for_bit(tmp_path):
    """Near the Gent lock load steps are cut; the resumed run knows how short they are now."""
    result = require_same_when_stopped(lambda: near_the_lock(9, 0.12, load_steps=3), tmp_path, [2, 3])
    assert cutbacks(result) and max(cutbacks(result)) <= 2.0 / 3.0 + 1e-9
    shares = [step["share"] for step in result.summary["solve"]["load_steps"]]
    assert 2.0 / 3.0 < shares[-2] < shares[-1] == 1.0


def test_a_resumed_run_fails_at_the_same_load_factor_bit_for_bit(tmp_path):
    settings = {"load_steps": 4, "most_cuts": 3, "most_iterations": 12}
    result = require_same_when_stopped(
        lambda: near_the_lock(13, 0.3, **settings), tmp_path, [2], status="not converged"
    )
    assert len(cutbacks(result)) == 4 and 0.25 < result.summary["solve"]["reached"] < 0.5
