"""Bits that must agree on every device: fused and single launches, ways to the same force, both ends of a bond."""

import numpy as np
import pytest
import shared_scenes
import warp as wp
from grid_sheets import holed
from helpers import GENT, jittered, square

from warp_pd import (
    BodyPath,
    BondAssociated,
    CriticalStretch,
    Explicit,
    Fixed,
    Motion,
    Pressure,
    RigidBall,
    RigidBody,
    Simulation,
    Sphere,
)
from warp_pd.device import graph, launches
from warp_pd.families import unpack
from warp_pd.kernels import block_sums
from warp_pd.kernels.numeric import numeric
from warp_pd.kernels.stable_step import power_iteration
from warp_pd.kernels.threads import WARP
from warp_pd.tearing import damage_field

RAMP = ((0.0, 0.0), (0.01, 1.0))


def struck(sheet, precision, fast=True):
    """A held, pulled and blown-up sheet, damped, that a ball strikes and tears."""
    return Simulation(
        sheet, BondAssociated(GENT, horizon=2.015, weights="plain", fast=fast),
        Explicit(0.05, frames=5, damping=2.0, safety=0.4, precision=precision),
        loads=[
            Fixed(sheet.edges("left")), Motion(sheet.edges("right"), (0.0, 0.05), x=(0.0, 0.02), y=0.0, z=0.0),
            Pressure(5.0, ramp=RAMP), Pressure(1.0, follower=False),
        ],
        contact=RigidBall(0.04, (0.05, 0.05, 0.021), (0.0, 0.0, -1.0)), damage=CriticalStretch(1.3),
    )  # fmt: skip


def left_behind(built):
    """Everything that a run leaves in the fields that a restart keeps."""
    return {name: array.numpy() for name, array in built.context.fields.in_restart().items()}


def assert_same(one, other):
    assert set(one) == set(other)
    for name, values in one.items():
        assert values.tobytes() == other[name].tobytes(), name


SHEETS = {"lattice": lambda: square(21), "cloud": lambda: jittered(21), "grid": lambda: holed(31, 0.006)}


@pytest.mark.parametrize(("layout", "precision"), [("lattice", 32), ("cloud", 64), ("grid", 32)])
def test_fused_launches_are_the_launches_one_by_one(device, joined_stages, monkeypatch, layout, precision):
    fused = struck(SHEETS[layout](), precision).run(device=device)
    # Launches are joined wherever that changes no bit, so nothing public keeps them apart.
    monkeypatch.setattr(launches, "_joined", lambda first, second: None)
    single = struck(SHEETS[layout](), precision).run(device=device)
    assert len(single.built.context.stages["step"]) > len(fused.built.context.stages["step"])
    assert single.frame.damage.max() > 0.0 and single.history == fused.history
    assert_same(*(left_behind(result.built) for result in (fused, single)))


def test_a_body_moves_on_beside_the_force_of_the_step_before(device, joined_stages):
    results = []
    for repeat in (1, 20):
        sheet, path = square(21), BodyPath.straight((0.05, 0.05, 0.0152), (0.5, 0.0, -0.2), 0.05)
        # Without schedules: the clock would tick beside the force.
        built = Simulation(
            sheet, BondAssociated(GENT, horizon=2.015, weights="plain"), Explicit(0.05),
            loads=[Fixed(sheet.edges("left"))], contact=RigidBody(Sphere(0.03), path, friction=0.3),
        ).build(device, 32)  # fmt: skip
        built.context.compile()
        built.state.step.fill_(1e-4)
        built.set_clock(1e-4, 1.0, 0.0)
        built.context.run("setup")
        sequence = built.context.sequence("step", repeat)
        moving = [item.side_stream for item in sequence.items if item.name == "follow_path"]
        assert sum(moving) == (repeat - 1 if "cuda" in device else 0)
        for _ in range(200 // repeat):
            sequence.run()
        results.append(left_behind(built))
    assert np.abs(results[0]["body_impulse"]).max() > 0.0
    assert_same(*results)


def test_side_streams_give_the_same_bits(device, monkeypatch):
    """The clock runs beside the forces; here it waits for them instead."""
    beside = struck(square(21), 32).run(device=device).built
    assert any(item.side_stream for item in beside.context.stages["step"])
    launch = launches.Stage.launch
    # Nothing public takes a launch off its side stream.
    monkeypatch.setattr(
        launches.Stage, "launch", lambda self, *a, side_stream=False, **k: launch(self, *a, side_stream=False, **k)
    )
    alone = struck(square(21), 32).run(device=device).built
    assert not any(item.side_stream for item in alone.context.stages["step"])
    assert graph.side_stream_waits(list(alone.context.stages["step"])).count(True) == 0
    assert_same(left_behind(beside), left_behind(alone))


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("torn", [False, True], ids=["undamaged", "torn"])
@pytest.mark.parametrize("layout", ["lattice", "grid"])
def test_strips_through_a_ring_give_the_same_bits(device, tune, layout, torn, precision):
    """Strips of a large sheet reuse the memory of earlier ones, and the list of families that are not undamaged."""
    results = []
    for ring in ({"lattice": 200, "grid": 300}[layout], 10**9):
        tune(lattice_bonds=0, ring=ring)
        simulation = struck(SHEETS[layout](), precision)
        if not torn:
            simulation.damage = None
        result = simulation.run(device=device)
        names = [part for item in result.built.context.stages["step"] for part in item.parts]
        # A CPU takes one kernel for all families.
        assert (names.count("undamaged_family_force") > 1) == (ring < 10**9 and "cuda" in device)
        results.append(left_behind(result.built))
    assert_same(*results)


@pytest.mark.parametrize("ring", [400, 2**19], ids=["strips", "whole"])
def test_damage_found_beside_the_force_or_before_it_gives_the_same_bits(device, tune, monkeypatch, ring):
    """A large sheet with a damage field computes the force of undamaged families before bonds break."""
    results = []
    tune(lattice_bonds=0, ring=ring)
    for many in (0, 10**9):
        monkeypatch.setattr(damage_field, "MANY_POINTS", many)
        result = shared_scenes.scene("field").run(device=device)
        assert result.frame.damage.max() > 0.9
        names = [item.name for item in result.built.context.stages["step"]]
        # A CPU has one kernel for all families, and several for the damage.
        assert ("find_damage" in names) == (many > 0 and "cuda" in device)
        if many == 0 and "cuda" in device:
            assert names.index("sweep") < names.index("undamaged_family_force") < names.index("finish")
        results.append(left_behind(result.built))
    assert_same(*results)


@pytest.mark.gpu
@pytest.mark.skipif(not wp.get_cuda_device_count(), reason="needs a GPU")
@pytest.mark.parametrize("precision", [32, 64])
def test_threads_that_share_a_block_of_points_leave_the_sums_of_one(precision):
    """The last block is not full."""
    types, rng, n = numeric(precision), np.random.default_rng(0), 10_001
    blocks, results = -(-n // block_sums.BLOCK), []
    vectors = [rng.normal(size=(n, 3)) for _ in range(3)]
    mass, held = rng.uniform(1.0, 2.0, n), rng.integers(0, 8, n).astype(np.uint8)
    for lanes in (1, WARP):
        made = [wp.array(values, dtype=types.vec3, device="cuda:0") for values in vectors]
        response, sums = made[2], wp.zeros((4, blocks), dtype=wp.float64, device="cuda:0")
        reach = wp.array([0.1], dtype=types.real, device="cuda:0")
        given = [wp.array(mass, dtype=types.real, device="cuda:0"), wp.array(held, device="cuda:0"), made[0], reach]
        kernels = power_iteration(precision, lanes)
        inputs = [*given, made[1], 0, response, sums]
        wp.launch(kernels.respond.kernel, lanes * blocks, inputs=inputs, device="cuda:0")
        found = [wp.zeros(1, dtype=types.real, device="cuda:0") for _ in range(2)]
        squared = wp.zeros(2, dtype=wp.float64, device="cuda:0")
        wp.launch(kernels.summarise.kernel, lanes, inputs=[sums, 0, *found, squared], device="cuda:0")
        arrays = {"response": response, "sums": sums, "scale": found[0], "momentum": found[1], "squared": squared}
        results.append({name: array.numpy() for name, array in arrays.items()})
    assert all(values.all() for values in (results[0][name] for name in ("sums", "scale", "momentum", "squared")))
    assert_same(*results)


@pytest.mark.parametrize("precision", [32, 64])
@pytest.mark.parametrize("layout", SHEETS)
def test_bonds_break_at_both_ends(device, layout, precision):
    built = struck(SHEETS[layout](), precision).run(device=device).built
    families, size = built.law.families, built.context.sheet.size
    intact = unpack(built.law.intact.numpy().T.copy(), families.members)
    exists = families.rows_of_points(families.exists)
    points, members = np.nonzero(exists)
    heads, reverse = families.heads(points, members), families.reverse_members(points, members)
    assert 0 < (~intact[points, members]).sum() < len(points)
    assert (intact[points, members] == intact[heads, reverse]).all()
    assert size == len(intact)
