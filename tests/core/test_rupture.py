"""Rupture: damage and its energy, spared points, and faces that tear."""

import numpy as np
import pytest
from helpers import NEO, build, jittered, sever, square, strain_energy, uniform
from small_runs import run

from warp_pd import BondAssociated, CriticalStretch, Explicit, Fixed, Motion, Sheet, Simulation
from warp_pd.families import pack, unpack


def test_tearing_a_strip_in_two():
    """Pulled apart at mid-height: damage appears, the halves separate, nothing is NaN, the energy balances."""
    sheet = Sheet.rectangle(0.04, 0.1, thickness=1e-3, density=1000.0, points=(9, 21)).cut(
        (-0.01, 0.0512), (0.016, 0.0512)
    )
    law = BondAssociated(NEO, horizon=3.015)
    top = sheet.edges("top")
    simulation = Simulation(
        sheet, law, Explicit(0.5, frames=25, damping=5.0, safety=0.1),
        loads=[Fixed(sheet.edges("bottom")), Motion(top, [0.0, 0.5], x=0.0, y=[0.0, 0.15], z=0.0)],
        damage=CriticalStretch(1.5),
    )  # fmt: skip
    result = simulation.run(device="cpu", precision=64)
    assert result.status == "finished", result.summary["message"]
    assert result.frame.damage.max() > 0.4
    assert not result.frame.intact_faces.all()
    damage = [row["mean_damage"] for row in result.history]
    assert (np.diff(damage) >= 0.0).all() and damage[0] == 0.0
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01
    assert result.history[-1]["rupture"] > 0.0


def test_every_bond_breaking_in_one_step_leaves_free_points():
    sheet = square(7)
    start = np.column_stack([sheet.points, np.zeros(sheet.size)]) * 1.0
    result = run(sheet, initial_displacement=start, damage=CriticalStretch(1.2), solver=Explicit(0.02, frames=2))
    assert result.status == "finished"
    assert (result.frame.damage == 1.0).all()
    assert not result.frame.intact_faces.any()


def test_spared_points_keep_their_bonds():
    sheet = square(7)
    start = np.column_stack([sheet.points, np.zeros(sheet.size)]) * 1.0
    spared = sheet.edges("left")
    damage = CriticalStretch(1.2, spared=spared)
    result = run(sheet, initial_displacement=start, damage=damage, solver=Explicit(0.002, frames=2))
    assert (result.frame.damage[spared] == 0.0).all()
    assert (result.frame.damage[sheet.edges("right")] == 1.0).all()


def test_nothing_breaks_below_the_critical_stretch():
    sheet = square(7)
    start = 0.15 * np.column_stack([sheet.points, np.zeros(sheet.size)])
    built = build(sheet, initial_displacement=start, damage=CriticalStretch(1.2))
    built.context.run("setup")
    built.state.step.assign(np.array([1e-6]))
    before = built.law.intact.numpy().copy()
    built.context.run("step")
    assert (built.law.intact.numpy() == before).all()


STRIP = Sheet.rectangle(0.1, 0.0125, thickness=1e-3, density=1000.0, points=(25, 4))


@pytest.mark.parametrize("horizon", [1.8, 3.0])
@pytest.mark.parametrize(
    "sheet", [square(13), STRIP, jittered(13, share=0.3), square(13).cut((0.01, 0.054), (0.06, 0.054))]
)
def test_a_face_is_torn_where_a_bond_along_its_edge_is_gone(sheet, horizon):
    built = build(sheet, horizon=horizon, damage=CriticalStretch(3.0))
    sever(built, ((0.0312, -0.01), (0.0529, 0.041)))
    families, intact = built.law.families, unpack(built.law.intact.numpy().T, built.law.families.members)
    exists, at = families.rows_of_points(families.exists), np.arange(sheet.size)
    head = families.neighbours if families.family_class is None else at[:, None] + families.shift
    gone = {(i, head[i, k]) for i, k in np.argwhere(exists & ~intact)}
    expected = [not any((t[a], t[b]) in gone for a, b in ((0, 1), (1, 2), (2, 0))) for t in sheet.triangles]
    built.context.run("frame")
    faces = built.to_host(built.rupture.intact_faces).view(bool)
    np.testing.assert_array_equal(faces, expected)
    assert 0 < (~faces).sum() < len(faces)


@pytest.mark.parametrize("layout", ["lattice", "cloud"])
def test_what_is_left_of_an_intersection_is_used_while_it_is_a_sample(layout):
    """Bonds are broken one by one; an intersection has energy while det K is half of what it was, and not below."""
    sheet = square(9) if layout == "lattice" else jittered(9)
    built = build(sheet, damage=CriticalStretch(1e3))
    families, centre = built.law.families, sheet.nearest(0.05, 0.05)
    u = uniform(sheet, [[1.3, 0.1], [0.0, 0.9], [0.0, 0.2]])
    common = unpack(families.common, families.members)
    row = centre if families.family_class is None else families.family_class[centre]
    bonds = families.bonds if families.bonds.ndim == 2 else families.bonds[row]
    common = common if families.bonds.ndim == 2 else common[row]
    influence = families.influence if families.influence.ndim == 1 else families.influence[row]
    share = influence * families.member_areas[row]

    def determinants(intact):
        c = share * intact
        K = np.einsum("jk,k,ka,kb->jab", common * 1.0, c, bonds, bonds)
        return np.linalg.det(K)

    whole = determinants(families.exists[row])
    order = np.random.default_rng(0).permutation(np.flatnonzero(families.exists[row]))
    density, used = [], []
    for broken in range(len(order)):
        intact = families.exists[row].copy()
        intact[order[:broken]] = False
        every = families.rows_of_points(families.exists).copy()
        every[centre] = intact
        built.law.intact.assign(np.ascontiguousarray(pack(every).T))
        strain_energy(built, u)
        density.append(built.law.strain_energy.numpy()[centre])
        used.append((determinants(intact) >= 0.5 * whole * (1 - 1e-9))[intact].sum())
    weight = np.array(density) / density[0]
    # Uniform stretch: all intersections have one energy density, so the energy counts the weights of those in use.
    assert used[0] == len(order) and used[-1] == 0
    assert all((w > 0.0) == (n > 0) for w, n in zip(weight, used, strict=True))
    assert (np.diff(weight) <= 1e-12).all()


@pytest.mark.parametrize("layout", [square, jittered])
def test_bonds_break_at_the_critical_stretch(layout):
    sheet = layout(7)
    for stretch, broken in ((1.1999, 0.0), (1.2001, 1.0)):
        start = uniform(sheet, stretch * np.eye(3)[:, :2])
        built = build(sheet, initial_displacement=start, damage=CriticalStretch(1.2))
        built.context.run("setup")
        built.state.step.assign(np.array([1e-9]))
        built.context.run("step")
        built.context.run("frame")
        assert (built.rupture.damage.numpy() == broken).all()
