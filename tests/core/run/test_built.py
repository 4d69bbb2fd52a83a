"""Composing a simulation: stages, the plan, what is compiled, owners, and loads in every solver."""

import re

import numpy as np
import pytest
from helpers import NEO, refused, square
from warp._src.context import user_modules

from warp_pd import (
    BodyForce,
    BondAssociated,
    CriticalEnergy,
    CriticalStretch,
    Explicit,
    Fixed,
    Measure,
    Newton,
    PointForce,
    Pressure,
    Relaxation,
    RigidBall,
    Simulation,
)
from warp_pd.interfaces import Load
from warp_pd.kernels.effects import Kernel

LAW = BondAssociated(NEO, horizon=2.015, weights="plain")
RAMP = ((0.0, 0.0), (1.0, 1.0))


def simulation(solver, loads=(), points=13, **parts):
    sheet = square(points)
    return Simulation(sheet, LAW, solver, loads=[Fixed(sheet.edges("left", "right")), *loads], **parts)


SCENES = {
    "explicit": lambda: simulation(Explicit(0.1, frames=2, damping=1.0), [Pressure(1.0, ramp=RAMP)]),
    "torn": lambda: simulation(
        Explicit(1e-2, frames=2, damping=1.0), [Pressure(1.0)], damage=CriticalStretch(1.2),
        contact=RigidBall(0.03, (0.05, 0.05, 0.02), (0.0, 0.0, -1.0)),
    ),
    "relaxation": lambda: simulation(
        Relaxation(tolerance=1e-3), [Pressure(1.0), BodyForce((0.0, 0.0, 1.0))], damage=CriticalStretch(2.0)
    ),
    "newton direct": lambda: simulation(Newton(preconditioner="direct"), [PointForce([84], (0.0, 0.0, 1e-3))]),
    "newton jacobi": lambda: simulation(Newton(preconditioner="jacobi"), [Pressure(1.0)]),
    "newton multigrid": lambda: simulation(
        Newton(preconditioner="multigrid"), [Pressure(1.0), BodyForce((0.0, 0.0, 1.0), ramp=RAMP)], points=25
    ),
}  # fmt: skip


def launches_of(built):
    return [launch for stage in built.context.stages.values() for launch in stage.launches()]


def kernels_of(built):
    """Modules of the kernels of a simulation; each kernel is one, named by its content."""
    return {launch.kernel.module for launch in launches_of(built)}


def kernels_of_law(built):
    """The same for the law, but for pointwise stages, which are compiled with those that they are joined to."""
    return {
        launch.kernel.module
        for launch in launches_of(built)
        if launch.owner == "BondAssociated" and isinstance(launch.source, Kernel)
    }


@pytest.mark.parametrize("name", SCENES)
def test_compile_leaves_nothing_to_compile_in_a_run(name):
    built = SCENES[name]().build("cpu", 64)
    kernels = kernels_of(built)
    built.context.compile()
    assert kernels and all(kernel.execs for kernel in kernels)
    loaded = {module for module in user_modules.values() if module.execs}
    assert SCENES[name]().run(device="cpu", precision=64).status == "finished"
    assert {module for module in user_modules.values() if module.execs} == loaded


@pytest.mark.parametrize("name", SCENES)
def test_plan_has_every_array_and_every_launch(name):
    built = SCENES[name]().build("cpu", 64)
    arrays, launches = SCENES[name]().plan("cpu", 64).split("\nlaunches\n")
    for stored in built.context.fields:
        assert any(row.split()[0] == stored.name for row in arrays.splitlines() if row.startswith("  ")), stored.name
    assert f"  {built.context.fields.nbytes} bytes, " in arrays
    for stage in built.context.stages.values():
        for item in stage:
            assert any(stage.name in row and item.name in row for row in launches.splitlines()), (stage.name, item.name)


def test_plan_has_coarse_lattices():
    plan = SCENES["newton multigrid"]().plan("cpu", 64)
    for stage in ("lattice 1 evaluate", "lattice 1 linearise", "dead loads", "start from coarser", "down", "up"):
        assert f"\n  {stage} " in plan, stage


def test_a_built_simulation_says_in_a_line_what_it_is():
    assert re.fullmatch(r"Built\(\d+ points, float64, on cpu, \d+ bytes\)", repr(compiled()))


def compiled(*loads, **parts):
    return simulation(Explicit(1.0), loads, **parts).build("cpu", 64)


def test_scenes_that_differ_in_numbers_share_all_kernels():
    assert kernels_of(compiled(Pressure(1.0))) == kernels_of(compiled(Pressure(2.0)))
    assert kernels_of(compiled(damage=CriticalStretch(2.0))) == kernels_of(compiled(damage=CriticalStretch(3.0)))


def test_scenes_with_other_parts_share_the_kernels_of_the_law():
    law = kernels_of_law(compiled())
    ball = RigidBall(0.03, (0.05, 0.05, 0.02), (0.0, 0.0, -1.0))
    assert law
    for other in (compiled(Pressure(1.0)), compiled(BodyForce((0.0, 0.0, 1.0))), compiled(contact=ball)):
        assert kernels_of_law(other) == law
    assert kernels_of_law(compiled(damage=CriticalStretch(2.0))) != law


@pytest.mark.parametrize(
    ("damage", "owner"),
    [(CriticalStretch(2.0), "CriticalStretch"), (CriticalEnergy(1.0), "CriticalEnergy")],
)
def test_owners_are_the_parts_that_ask(damage, owner):
    law = BondAssociated(NEO, horizon=2.015, weights="plain", fast=False)
    built = Simulation(square(9), law, Explicit(1.0), damage=damage).build("cpu", 64)
    owners = {stored.name: stored.owner for stored in built.context.fields}
    assert owners["damage"] == owner
    breaking = [item for item in built.context.stages["step"] if item.name == "break_bonds"]
    assert [item.owner for item in breaking] == [owner]
    other = {"CriticalStretch", "CriticalEnergy"} - {owner}
    launched = {item.owner for stage in built.context.stages.values() for item in stage}
    used = set(owners.values()) | launched
    assert not used & other


LOADS = {
    "Pressure": lambda ramp: Pressure(1.0, follower=False, ramp=ramp),
    "follower": lambda ramp: Pressure(1.0, ramp=ramp),
    "BodyForce": lambda ramp: BodyForce((0.0, 0.0, 1e3), ramp=ramp),
    "PointForce": lambda ramp: PointForce([60, 84], (0.0, 0.0, 1e-3), ramp=ramp),
}
ENDS = {"ramped": ((0.0, 0.0), (1.0, 2.0)), "twice": None}


@pytest.mark.parametrize("load", LOADS)
@pytest.mark.parametrize("solver", [Relaxation(tolerance=1e-10), Newton(tolerance=1e-12)], ids=["relaxation", "newton"])
def test_a_ramp_that_ends_at_two_is_twice_the_load(load, solver):
    """No load is left out of a solver, and its schedule counts."""
    results = []
    for loads in ([LOADS[load](ENDS["ramped"])], [LOADS[load](None), LOADS[load](None)]):
        result = simulation(solver, loads).run(device="cpu", precision=64)
        assert result.status == "finished"
        results.append(result.frame.displacement)
    assert np.abs(results[0]).max() > 1e-4
    np.testing.assert_allclose(results[0], results[1], atol=1e-7 * np.abs(results[0]).max())


@pytest.mark.parametrize("load", LOADS)
def test_a_ramp_in_explicit_dynamics_is_the_load_at_its_end(load):
    """After the ramp, the external force is that of the load with its last factor."""
    forces = []
    for loads in ([LOADS[load](((0.0, 2.0), (1.0, 2.0)))], [LOADS[load](None), LOADS[load](None)]):
        built = simulation(Explicit(1e-3, frames=1), loads).run(device="cpu", precision=64).built
        forces.append(built.to_numpy(built.state.external))
    assert np.abs(forces[0]).max() > 0.0
    np.testing.assert_allclose(forces[0], forces[1], rtol=1e-12, atol=1e-15 * np.abs(forces[0]).max())


@pytest.mark.parametrize("name", ["time", "step", "kinetic", "ball_force_x", "largest_damage"])
def test_a_measure_cannot_take_the_name_of_a_column(name):
    measure = Measure(name, "1", lambda built, frame: 0.0)
    ball = RigidBall(0.03, (0.05, 0.05, 0.02))
    said = f"measures: '{name}' is already a column of the history: expected another name"
    with refused(match=said):
        simulation(Explicit(1.0), damage=CriticalStretch(2.0), contact=ball, measures=[measure]).build("cpu")


def test_a_part_without_build_is_named():
    class Nothing(Load):
        pass

    with pytest.raises(NotImplementedError, match=r"^Nothing\.build: expected an implementation$"):
        simulation(Explicit(1.0), [Nothing()]).build("cpu")
