"""The empirical boundary force (BA eq. 45): the formula, momentum, objectivity, stability, energy balance."""

import numpy as np
import pytest
from boundary_forces import HORIZON, SHEETS, A, built_on, lifted, positions, rotated, rotation_of
from helpers import array, random_gradient, rough, sever, square, uniform

from warp_pd import BondAssociated, BoundaryForce, Explicit, Fixed, NeoHookean, Pressure, Relaxation, Simulation
from warp_pd.papers.boundary_force import near_edges

MIRROR = np.array([1.0, 1.0, -1.0])


def force(built, displacement):
    """Boundary force [N], shape (N, 3)."""
    built.state.displacement.assign(displacement.astype(built.state.displacement.numpy().dtype))
    built.context.run("setup")
    return built.to_numpy(built.state.external)


def exact(sheet, displacement, carriers, form, horizon=HORIZON, lost=()):
    """Eq. 45 point by point in numpy: all pairs within the horizon, normals of the family's plane."""
    delta, Y = horizon * sheet.spacing, positions(sheet, displacement)
    volume = sheet.areas * sheet.thickness
    away = np.linalg.norm(sheet.points[:, None] - sheet.points[None], axis=-1)
    near = (away > 0.0) & (away <= delta * (1.0 + 1e-9))
    for i, j in lost:
        near[i, j] = near[j, i] = False
    total = np.zeros((sheet.size, 3))
    for i in carriers:
        j = np.flatnonzero(near[i])
        c = (1.0 - np.minimum(away[i, j] / delta, 1.0)) * volume[j]
        X, y = sheet.points[j] - sheet.points[i], Y[j] - Y[i]
        F = np.einsum("k,ka,kb->ab", c, y, X) @ np.linalg.inv(np.einsum("k,ka,kb->ab", c, X, X))
        d = np.cross(F[:, 0], F[:, 1])
        d /= np.linalg.norm(d)
        n = d if form == "normal" else y / np.linalg.norm(y, axis=1)[:, None]
        pair = (volume[i] * c * A * (y @ d))[:, None] * n
        total[i] += pair.sum(axis=0)
        np.add.at(total, j, -pair)
    return total


@pytest.mark.parametrize("form", ["normal", "printed"])
@pytest.mark.parametrize("sheet", ["lattice", "cloud", "jittered"])
def test_it_is_equation_45(sheet, form):
    """Against numpy, at a rough state: units, weights, volumes and signs included."""
    built = built_on(sheet, form)
    s = built.simulation.sheet
    u = rough(s, 0.3)
    expected = exact(s, u, near_edges(s, HORIZON * s.spacing), form)
    assert np.abs(expected).max() > 1e-4
    assert force(built, u) == pytest.approx(expected, abs=1e-11 * np.abs(expected).max())


@pytest.mark.parametrize(
    ("form", "precision", "limit"), [("normal", 64, 1e-15), ("printed", 64, 1e-15), ("normal", 32, 1e-6)]
)
def test_momentum_is_conserved(form, precision, limit):
    built = built_on("lattice", form, precision)
    found = force(built, rough(built.simulation.sheet, 0.3))
    assert np.abs(found.sum(axis=0)).max() < limit * np.abs(found).sum()


def moment(built, displacement):
    """Total moment over the sum of the moments' sizes."""
    arms = positions(built.simulation.sheet, displacement)
    moments = np.cross(arms - arms.mean(axis=0), force(built, displacement))
    return np.linalg.norm(moments.sum(axis=0)) / np.linalg.norm(moments, axis=1).sum()


def test_angular_momentum():
    """Exact for the printed form, whose forces are central; the other loses what is second order in a deflection."""
    u = rough(SHEETS["lattice"](), 0.3)
    assert moment(built_on("lattice", "printed"), u) < 1e-13
    normal = built_on("lattice", "normal")
    large, small = (moment(normal, size * u * (0.0, 0.0, 1.0)) for size in (0.1, 0.01))
    assert 1e-6 < large < 1e-2
    assert large / small == pytest.approx(100.0, rel=0.2)


@pytest.mark.parametrize("form", ["normal", "printed"])
@pytest.mark.parametrize("sheet", ["lattice", "jittered", "cut"])
def test_no_force_on_a_plane_however_stretched_and_rotated(sheet, form):
    built = built_on(sheet, form)
    s = built.simulation.sheet
    scale = np.abs(force(built, rough(s, 0.3))).max()
    in_plane = 0.3 * s.spacing * np.random.default_rng(1).normal(size=(s.size, 3)) * (1.0, 1.0, 0.0)
    for u in (uniform(s, random_gradient(3)), rotated(s, in_plane, rotation_of(4))):
        assert np.abs(force(built, u)).max() < 1e-12 * scale


def test_a_lifted_corner_is_pulled_back_in_proportion():
    built = built_on("lattice", "normal")
    s = built.simulation.sheet
    for corner in (0, s.size - 1):
        small = force(built, lifted(s, corner, 1e-6 * s.spacing))[corner]
        double = force(built, lifted(s, corner, 2e-6 * s.spacing))[corner]
        down = force(built, lifted(s, corner, -1e-6 * s.spacing))[corner]
        assert small[2] < 0.0 < down[2]
        assert double == pytest.approx(2.0 * small, rel=1e-5, abs=1e-5 * abs(small[2]))
        # Perpendicular to the plane, as the paper says in words.
        assert np.abs(small[:2]).max() < 1e-5 * abs(small[2])


def test_the_normal_form_only_ever_restores_a_flat_sheet():
    """Its tangent in the deflections is symmetric and has no positive eigenvalue; only planes feel nothing."""
    built = built_on("lattice", "normal")
    s = built.simulation.sheet
    step = 1e-6 * s.spacing
    tangent = np.array([force(built, lifted(s, i, step))[:, 2] for i in range(s.size)]) / step
    scale = np.abs(tangent).max()
    assert np.abs(tangent - tangent.T).max() < 1e-7 * scale
    assert np.linalg.eigvalsh(0.5 * (tangent + tangent.T)).max() < 1e-7 * scale


def test_the_printed_form_pushes_to_one_side():
    """The mirrored state has minus the mirrored force, and a corner is pushed up from above and from below."""
    built = built_on("lattice", "printed")
    s = built.simulation.sheet
    u = rough(s, 0.3)
    before, after = force(built, u), force(built, u * MIRROR)
    assert after == pytest.approx(-before * MIRROR, abs=1e-12 * np.abs(before).max())
    assert np.abs(after - before * MIRROR).max() > np.abs(before).max()
    alone = built_on("lattice", "printed", points=(0,))
    up, down = (force(alone, lifted(s, 0, sign * 0.1 * s.spacing))[0] for sign in (1.0, -1.0))
    assert up[2] == pytest.approx(down[2]) and up[2] > 0.0
    # To first order it is a force in the plane.
    small = force(alone, lifted(s, 0, 1e-4 * s.spacing))[0]
    assert np.linalg.norm(small[:2]) > 1e3 * abs(small[2])


def test_float32_agrees_with_float64():
    u = rough(SHEETS["lattice"](), 0.3)
    single, double = (force(built_on(precision=bits), u) for bits in (32, 64))
    assert single == pytest.approx(double, abs=2e-6 * np.abs(double).max())
    # A small deflection of a sheet in its place keeps its digits: no large numbers are taken away.
    u = 1e-5 * u * (0.0, 0.0, 1.0)
    single, double = (force(built_on(precision=bits), u) for bits in (32, 64))
    assert single == pytest.approx(double, abs=2e-6 * np.abs(double).max())


@pytest.mark.parametrize("sheet", ["lattice", "cloud"])
def test_only_the_carriers_and_their_neighbours_feel_it(sheet):
    built = built_on(sheet, points=(0, 1))
    s = built.simulation.sheet
    found = force(built, rough(s, 0.3))
    reached = np.unique(np.append(built.law.families.members_of(np.array([0, 1])), [0, 1]))
    assert set(np.flatnonzero(np.abs(found).max(axis=1) > 0.0)) <= set(reached[reached >= 0])
    assert found == pytest.approx(exact(s, rough(s, 0.3), [0, 1], "normal"), abs=1e-11 * np.abs(found).max())
    assert set(np.flatnonzero(array(built, "edge_normals").numpy().any(axis=1))) == {0, 1}


@pytest.mark.parametrize("sheet", ["lattice", "cloud"])
def test_points_that_lost_a_bond_join(sheet):
    built = built_on(sheet, points=(0,), breakable=True)
    s = built.simulation.sheet
    undamaged = built.law.intact.numpy().copy()
    u = rough(s, 0.3)
    force(built, u)
    assert set(np.flatnonzero(array(built, "edge_normals").numpy().any(axis=1))) == {0}
    try:
        lost = sever(built, ((0.03, 0.0444), (0.07, 0.0444)))
        members = built.law.families.members_of(np.arange(s.size))
        i, k = np.nonzero(lost & (members >= 0))
        torn = np.unique(i)
        found = force(built, u)
        assert len(torn) > 8
        assert set(np.flatnonzero(array(built, "edge_normals").numpy().any(axis=1))) == {0, *torn}
        expected = exact(s, u, sorted({0, *torn}), "normal", lost=zip(i, members[i, k], strict=True))
        assert found == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())
        # A point without a bond has no plane and no force.
        built.law.intact.assign(np.zeros_like(undamaged))
        assert (force(built, u) == 0.0).all()
    finally:
        built.law.intact.assign(undamaged)


def test_a_run_keeps_its_energy_balance():
    """Its work is external work, to the second order of the time step."""
    sheet = square(9)
    start = lifted(sheet, 0, 0.3 * sheet.spacing) + lifted(sheet, sheet.size - 1, -0.2 * sheet.spacing)
    law = BondAssociated(NeoHookean(1e3, 1e5), weights="plain")
    errors = []
    for safety in (0.16, 0.08):
        result = Simulation(
            sheet, law, Explicit(0.05, frames=10, safety=safety, retries=0), loads=[BoundaryForce(1e13), Fixed([40])],
            initial_displacement=start,
        ).run(device="cpu", precision=64)  # fmt: skip
        assert result.status == "finished"
        energy = result.history[-1]["strain"] + result.history[-1]["kinetic"]
        assert result.history[-1]["external"] > 0.5 * energy
        errors.append(max(abs(row["balance_error"]) for row in result.history[1:]))
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)


def test_static_equilibrium_with_it():
    """A sheet under pressure finds its equilibrium, its edges a little stiffer and its middle where it was."""
    sheet = square(11)
    law = BondAssociated(NeoHookean(1e3, 1e5), weights="plain")

    def deflection(value):
        loads = [Fixed(sheet.edges()), Pressure(5.0), BoundaryForce(value)]
        result = Simulation(sheet, law, Relaxation(most_steps=20_000), loads=loads).run(device="cpu")
        assert result.status == "finished"
        return result.frame.displacement[sheet.nearest(0.05, 0.05), 2]

    without, with_it = deflection(0.0), deflection(1e12)
    assert with_it == pytest.approx(without, rel=0.02)
    assert with_it != pytest.approx(without, rel=1e-5)
