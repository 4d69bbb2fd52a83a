"""A grid with gaps: the same forces, energies, weights and cracks as the same sheet as a cloud."""

import numpy as np
import pytest
from grid_sheets import deep, holed, partly_off_the_grid
from helpers import NEO, build, internal_force, rough, sever, soften, strain_energy
from visco_laws import LAWS as VISCOUS

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    BondNeoHookean,
    CriticalStretch,
    Explicit,
    Fixed,
    HyperelasticBonds,
    Motion,
    Neural,
    Newton,
    Nodal,
    Simulation,
    TearingEnergy,
)
from warp_pd.families import weights

TOLERANCE = {32: 3e-6, 64: 1e-12}
# From the edge of the hole, across deep families.
TEAR = ((0.05, 0.0533), (0.083, 0.0571))


def launch_names(built):
    return [name for launch in built.context.stages["step"] for name in launch.parts]


def close(one, other, tolerance):
    assert np.abs(other).max() > 0.0
    assert np.abs(one - other).max() <= tolerance * np.abs(other).max()


@pytest.mark.parametrize(("horizon", "bits"), [(1.5, 64), (2.015, 32), (3.15, 64)])
def test_forces_and_energy_are_those_of_the_cloud(horizon, bits):
    sheet, found = holed(45, 0.007), []
    for same, fast in ((sheet, True), (sheet.as_cloud(), False)):
        built = build(same, horizon=horizon, precision=bits, law={"fast": fast}, damage=CriticalStretch(1e3))
        undamaged = internal_force(built, rough(sheet)), strain_energy(built, rough(sheet))
        broken = sever(built, TEAR)
        found.append((*undamaged, internal_force(built, rough(sheet)), strain_energy(built, rough(sheet))))
        if fast:
            assert broken[deep(built)].any() and deep(built).mean() > 0.03
            assert "family_rows_force" in launch_names(built)
    for one, other in zip(*found, strict=True):
        close(one, other, TOLERANCE[bits])
    assert np.abs(found[0][0] - found[0][2]).max() > 0.1 * np.abs(found[0][0]).max()


@pytest.mark.parametrize("weights", ["plain", "corrected", "published"])
def test_points_off_the_grid_take_part(weights):
    sheet = partly_off_the_grid(33)
    fast, cloud = (build(s, horizon=2.015, weights=weights) for s in (sheet, sheet.as_cloud()))
    assert deep(fast).any()
    close(internal_force(fast, rough(sheet)), internal_force(cloud, rough(sheet)), 1e-12)
    assert (fast.law.force_path != "reference") == (weights != "published")


def test_families_that_lost_stiffness():
    sheet, forces = holed(), []
    for same, fast in ((sheet, True), (sheet.as_cloud(), False)):
        built = build(same, horizon=2.015, law={"fast": fast}, damage=TearingEnergy(10.0))
        soften(built)
        forces.append(internal_force(built, rough(sheet)))
    close(*forces, 1e-12)


LAWS = {
    "nodal": Nodal(NEO),
    "closed form": Neural(NEO, evaluation="closed_form"),
    "bond-based": BondBased(Bimodular(1e4, 3e3)),
    "hyperelastic bonds": HyperelasticBonds(BondNeoHookean(1e3, "uniaxial", "refitted")),
    "visco": VISCOUS["stress-free"],
    "visco bonds": VISCOUS["published"],
}


@pytest.mark.parametrize("name", LAWS)
def test_laws_give_the_forces_of_the_cloud(name):
    sheet, forces = holed(41), []
    for same in (sheet, sheet.as_cloud()):
        built = Simulation(same, LAWS[name], Explicit(1.0), damage=CriticalStretch(1e3)).build("cpu", 64)
        sever(built, TEAR)
        forces.append(internal_force(built, rough(sheet, 0.01)))
        if same is sheet:
            assert deep(built).mean() > 0.1
    close(*forces, 1e-12)


@pytest.mark.parametrize(
    ("sheet", "horizon"),
    [(holed(41), 1.5), (holed(41), 3.15), (holed(33).cut((0.058, 0.0533), (0.075, 0.0533)), 2.015)],
)
def test_corrected_weights_are_those_of_the_cloud(sheet, horizon):
    grid, cloud = (build(s, horizon=horizon, weights="corrected").law for s in (sheet, sheet.as_cloud()))
    exists = cloud.families.exists
    assert (grid.families.family_class == 0).any()
    of_grid = grid.struct.weights.numpy().T[grid.families.family_class][:, : exists.shape[1]]
    of_cloud = cloud.struct.weights.numpy().T
    np.testing.assert_allclose(of_grid, of_cloud, rtol=0.0, atol=1e-10 * of_cloud.max())
    for entry in ("smallest_ratio", "largest_ratio", "residual_of_plain", "points_left_unbalanced"):
        assert grid.correction[entry] == pytest.approx(cloud.correction[entry], rel=1e-7)


def test_weights_are_corrected_around_the_gaps_alone(monkeypatch):
    sizes = []
    whole = weights._Table
    # The correction says how well it did, not at how many points it worked.
    monkeypatch.setattr(weights, "_Table", lambda points, *rest: sizes.append(len(points)) or whole(points, *rest))
    sheet = holed(81, 0.006)
    build(sheet, horizon=1.5, weights="corrected")
    assert 0 < sizes[0] < 0.5 * sheet.size


def test_a_sheet_tears_as_the_cloud_does():
    sheet, results = holed(), []
    for same in (sheet, sheet.as_cloud()):
        built = build(same, horizon=2.015, damage=CriticalStretch(1.35), solver=Explicit(duration=0.02))
        built.state.velocity.assign(np.column_stack([90.0 * sheet.points[:, 0], 0 * sheet.points]))
        internal_force(built, np.zeros((sheet.size, 3)))
        built.state.step.fill_(1e-5)
        sequence = []
        for _ in range(4):
            built.context.sequence("step", 150).run()
            sequence.append(built.law.intact.numpy().copy())
        results.append((np.array(sequence), built.to_numpy(built.state.displacement)))
    (intact, moved), (expected, cloud_moved) = results
    assert (intact == expected).all()
    broken = [(bits != intact[0]).sum() for bits in intact]
    assert broken[-1] > broken[1]
    close(moved, cloud_moved, 1e-9)


@pytest.mark.parametrize(
    ("force", "preconditioner"),
    [(BondAssociated(NEO, horizon=2.015, weights="corrected"), "jacobi"), (BondBased(Bimodular(1e4, 3e3)), "direct")],
)
def test_equilibrium_is_that_of_the_cloud(force, preconditioner):
    sheet, frames = holed(25), []
    for same in (sheet, sheet.as_cloud()):
        loads = [
            Fixed(sheet.edges("left")), Fixed(range(sheet.size), "z"),
            Motion(sheet.edges("right"), (0.0, 1.0), x=(0.0, 0.02), y=0.0),
        ]  # fmt: skip
        solver = Newton(tolerance=1e-10, preconditioner=preconditioner)
        found = Simulation(same, force, solver, loads=loads).run(device="cpu")
        assert found.status == "finished"
        frames.append(found.frame.displacement)
    close(*frames, 1e-8)
