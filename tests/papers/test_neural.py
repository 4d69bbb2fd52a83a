"""Nodal, neural and closed-form laws: objectivity, momentum, the gradient of the energy, damaged families."""

import numpy as np
import pytest
from helpers import GENT, NEO, internal_force, jittered, rough, square, strain_energy, uniform
from point_laws import LAWS, build, damaged

from warp_pd import CriticalStretch, Explicit, Fixed, Neural, Nodal, Pressure, Simulation

# All tests of these laws share the kernels of breakable families; test_neural_evaluations.py has others.
BREAKABLE = CriticalStretch(9.0)


@pytest.mark.parametrize(("law", "precision"), [*((law, 64) for law in LAWS), ("nodal", 32), ("closed form", 32)])
def test_rigid_motion_gives_no_force_and_momentum_is_conserved(law, precision):
    sheet = square(11)
    built = build(sheet, LAWS[law](), precision, damage=BREAKABLE)
    rotation, _ = np.linalg.qr(np.random.default_rng(5).normal(size=(3, 3)))
    tolerance = 1e-12 if precision == 64 else 1e-4
    strained = np.abs(internal_force(built, uniform(sheet, 1.1 * rotation[:, :2]))).max()
    moved = uniform(sheet, rotation[:, :2]) + [0.3, -0.2, 0.5]
    assert np.abs(internal_force(built, moved)).max() < 10 * tolerance * strained
    force = internal_force(built, rough(sheet))
    assert np.abs(force.sum(axis=0)).max() < tolerance * np.abs(force).max()


@pytest.mark.parametrize("law", LAWS)
def test_forces_rotate_with_the_sheet(law):
    sheet = square(11)
    built = build(sheet, LAWS[law](), damage=BREAKABLE)
    rotation, _ = np.linalg.qr(np.random.default_rng(7).normal(size=(3, 3)))
    flat = np.column_stack([sheet.points, np.zeros(sheet.size)])
    displacement = rough(sheet)
    rotated = (flat + displacement) @ rotation.T - flat
    force = internal_force(built, displacement)
    assert internal_force(built, rotated) == pytest.approx(force @ rotation.T, abs=1e-10 * np.abs(force).max())


NODAL = {
    "lattice": lambda: build(square(9), Nodal(NEO)),
    "Gent, short horizon": lambda: build(square(9), Nodal(GENT, horizon=1.5)),
    "cloud": lambda: build(jittered(9), Nodal(NEO)),
    "cut": lambda: build(square(9).cut((-0.01, 0.045), (0.045, 0.045)), Nodal(NEO)),
    "damaged": lambda: damaged(square(11), Nodal(NEO)),
}


@pytest.mark.parametrize("case", NODAL)
def test_the_nodal_force_is_minus_the_gradient_of_its_energy(case):
    built = NODAL[case]()
    sheet = built.simulation.sheet
    displacement = rough(sheet)
    force = internal_force(built, displacement)
    rng = np.random.default_rng(3)
    for _ in range(3):
        direction = rng.normal(size=(sheet.size, 3)) * sheet.spacing
        up, down = (strain_energy(built, displacement + s * 1e-5 * direction) for s in (1.0, -1.0))
        assert (up - down) / 2e-5 == pytest.approx(
            -(force * direction).sum(), abs=2e-7 * np.abs(force * direction).sum()
        )


@pytest.mark.parametrize("law", LAWS)
def test_damaged_families_stay_finite_and_conserve_momentum(law):
    built = damaged(square(11), LAWS[law]())
    force = internal_force(built, rough(built.simulation.sheet))
    assert np.isfinite(force).all()
    assert np.abs(force[44]).max() == 0.0
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * np.abs(force).max()


def test_a_bond_turned_over_is_pushed_back():
    """Past the pole of the closed form at 90 degrees the force stays finite, and works against the turn."""
    sheet = square(15)
    built = build(sheet, Neural(NEO, evaluation="closed_form"))
    middle = sheet.nearest(0.05, 0.05)
    largest = []
    for share in (0.9, 1.0, 1.1, 1.5):
        u = np.zeros((sheet.size, 3))
        u[middle, 0] = share * sheet.spacing
        force = internal_force(built, u)
        assert force[middle, 0] < 0.0
        largest.append(np.abs(force).max())
    assert np.isfinite(largest).all() and max(largest) < 1e3 * NEO.mu * sheet.thickness * sheet.spacing


def test_a_law_without_an_energy_invents_none(tmp_path):
    sheet = square(9)
    for law, known in ((Neural(NEO, evaluation="closed_form"), False), (Nodal(NEO), True)):
        simulation = Simulation(
            sheet,
            force=law,
            solver=Explicit(duration=0.02, frames=4, damping=1.0),
            loads=[Fixed(sheet.edges("all")), Pressure(5.0)],
            damage=CriticalStretch(1.2),
            initial_displacement=uniform(sheet, [[1.1, 0.0], [0.0, 1.0], [0.0, 0.0]]) + rough(sheet, 0.1) * 0.3,
        )
        result = simulation.run(device="cpu", out=tmp_path / type(law).__name__, usd=False)
        row, energy = result.history[-1], result.summary["energy"]
        assert result.status == "finished"
        assert row["largest_damage"] > 0.0
        assert ("strain" in row) is ("rupture" in row) is ("balance_error" in row) is known
        assert (energy["strain"] is not None) is (energy["balance_error"] is not None) is known
        assert row["kinetic"] > 0.0 and row["external"] != 0.0 and row["damping"] > 0.0
        assert any("no potential" in n for n in result.summary["notes"]) is not known
        if known:
            assert abs(row["balance_error"]) < 0.05
