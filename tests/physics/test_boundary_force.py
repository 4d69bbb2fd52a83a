"""The empirical boundary force (BA eq. 45), and the distance from the local plane that it is meant to bound."""

from functools import cache
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import array, build, jittered, random_gradient, rough, sever, square, uniform

from warp_pd import (
    BondAssociated,
    BoundaryForce,
    CriticalStretch,
    Explicit,
    Fixed,
    InputError,
    NeoHookean,
    Pressure,
    Relaxation,
    Simulation,
)
from warp_pd.out_of_plane import distance_from_local_plane, family_members
from warp_pd.parts.boundary_force import near_edges

A = 2e12
HORIZON = 2.015
MIRROR = np.array([1.0, 1.0, -1.0])
SHEETS = {
    "lattice": lambda: square(9),
    "cloud": lambda: square(9).as_cloud(),
    "jittered": lambda: jittered(9),
    "cut": lambda: square(9).cut((-0.01, 0.0444), (0.0511, 0.0444)),
}


@cache
def built_on(sheet="lattice", form="normal", precision=64, points=None, breakable=False, horizon=HORIZON):
    return build(
        SHEETS[sheet](), horizon=horizon, precision=precision,
        loads=[BoundaryForce(A, points=None if points is None else list(points), form=form)],
        damage=CriticalStretch(50.0) if breakable else None,
    )  # fmt: skip


def force(built, displacement):
    """Boundary force [N], shape (N, 3)."""
    built.state.displacement.assign(displacement.astype(built.state.displacement.numpy().dtype))
    built.context.run("setup")
    return built.to_numpy(built.state.external)


def positions(sheet, displacement):
    return np.column_stack([sheet.points, np.zeros(sheet.size)]) + displacement


def turned(sheet, displacement, rotation):
    return positions(sheet, displacement) @ rotation.T - positions(sheet, 0.0)


def rotation_of(seed):
    q, r = np.linalg.qr(np.random.default_rng(seed).normal(size=(3, 3)))
    q *= np.sign(np.diag(r))
    return q * np.linalg.det(q)


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
def test_no_force_on_a_plane_however_stretched_and_turned(sheet, form):
    built = built_on(sheet, form)
    s = built.simulation.sheet
    scale = np.abs(force(built, rough(s, 0.3))).max()
    in_plane = 0.3 * s.spacing * np.random.default_rng(1).normal(size=(s.size, 3)) * (1.0, 1.0, 0.0)
    for u in (uniform(s, random_gradient(3)), turned(s, in_plane, rotation_of(4))):
        assert np.abs(force(built, u)).max() < 1e-12 * scale


@pytest.mark.parametrize("form", ["normal", "printed"])
def test_force_turns_with_the_sheet(form):
    built = built_on("lattice", form)
    s = built.simulation.sheet
    u, rotation = rough(s, 0.3), rotation_of(2)
    before = force(built, u)
    assert np.abs(force(built, turned(s, u, rotation)) - before @ rotation.T).max() < 1e-11 * np.abs(before).max()


def lifted(sheet, point, height):
    u = np.zeros((sheet.size, 3))
    u[point, 2] = height
    return u


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


def test_the_normal_form_mirrors():
    built = built_on("lattice", "normal")
    u = rough(built.simulation.sheet, 0.3)
    before, after = force(built, u), force(built, u * MIRROR)
    assert after == pytest.approx(before * MIRROR, abs=1e-12 * np.abs(before).max())


@pytest.mark.parametrize(("form", "breakable"), [("normal", False), ("printed", False), ("normal", True)])
def test_lattice_and_cloud_agree(form, breakable):
    u = rough(SHEETS["lattice"](), 0.3)
    lattice, cloud = (force(built_on(sheet, form, breakable=breakable), u) for sheet in ("lattice", "cloud"))
    assert cloud == pytest.approx(lattice, abs=1e-12 * np.abs(lattice).max())


def test_float32_agrees_with_float64():
    u = rough(SHEETS["lattice"](), 0.3)
    single, double = (force(built_on(precision=bits), u) for bits in (32, 64))
    assert single == pytest.approx(double, abs=2e-6 * np.abs(double).max())
    # A small deflection of a sheet in its place keeps its digits: no large numbers are taken away.
    u = 1e-5 * u * (0.0, 0.0, 1.0)
    single, double = (force(built_on(precision=bits), u) for bits in (32, 64))
    assert single == pytest.approx(double, abs=2e-6 * np.abs(double).max())


@pytest.mark.parametrize("horizon", [2.015, 3.0, 3.15])
def test_carriers_are_the_points_less_than_a_horizon_from_an_edge(horizon):
    sheet = square(13)
    x, y = sheet.points.T
    gap = np.minimum.reduce([x, y, 0.1 - x, 0.1 - y])
    expected = np.flatnonzero(gap < horizon * sheet.spacing * (1.0 - 1e-6))
    assert (near_edges(sheet, horizon * sheet.spacing) == expected).all()
    assert 0 < len(expected) < sheet.size
    # Every point whose family lacks members is among them.
    families = build_families_of(sheet, horizon)
    cut_short = np.flatnonzero((family_members(families, np.arange(sheet.size)) < 0).any(axis=1))
    assert np.isin(cut_short, expected).all()


def build_families_of(sheet, horizon):
    from warp_pd.families import build_families

    return build_families(sheet, horizon, "linear")


def test_cuts_and_holes_are_edges():
    sheet = square(25)
    reach = 2.015 * sheet.spacing
    middle = np.linalg.norm(sheet.points - 0.05, axis=1)
    slit = sheet.cut((0.04, 0.0512), (0.06, 0.0512))
    hole = sheet.hole((0.05, 0.05), 0.015)
    assert not np.isin(np.flatnonzero(middle < 0.02), near_edges(sheet, reach)).any()
    assert np.isin(slit.nearest(0.05, 0.05), near_edges(slit, reach))
    assert np.isin(slit.nearest(0.05, 0.055), near_edges(slit, reach))
    assert not np.isin(slit.nearest(0.05, 0.07), near_edges(slit, reach))
    around = np.linalg.norm(hole.points - 0.05, axis=1)
    marked = np.isin(np.arange(hole.size), near_edges(hole, reach))
    assert marked[around < 0.018].all() and not marked[(around > 0.03) & (around < 0.04)].any()


@pytest.mark.parametrize("sheet", ["lattice", "cloud"])
def test_only_the_carriers_and_their_neighbours_feel_it(sheet):
    built = built_on(sheet, points=(0, 1))
    s = built.simulation.sheet
    found = force(built, rough(s, 0.3))
    reached = np.unique(np.append(family_members(built.law.families, np.array([0, 1])), [0, 1]))
    assert set(np.flatnonzero(np.abs(found).max(axis=1) > 0.0)) <= set(reached[reached >= 0])
    assert found == pytest.approx(exact(s, rough(s, 0.3), [0, 1], "normal"), abs=1e-11 * np.abs(found).max())
    assert set(np.flatnonzero(array(built, "edge_normals").numpy().any(axis=1))) == {0, 1}


@pytest.mark.parametrize("sheet", ["lattice", "cloud"])
def test_points_that_lost_a_bond_join(sheet):
    built = built_on(sheet, points=(0,), breakable=True)
    s = built.simulation.sheet
    whole = built.law.intact.numpy().copy()
    u = rough(s, 0.3)
    force(built, u)
    assert set(np.flatnonzero(array(built, "edge_normals").numpy().any(axis=1))) == {0}
    try:
        lost = sever(built, ((0.03, 0.0444), (0.07, 0.0444)))
        members = family_members(built.law.families, np.arange(s.size))
        i, k = np.nonzero(lost & (members >= 0))
        torn = np.unique(i)
        found = force(built, u)
        assert len(torn) > 8
        assert set(np.flatnonzero(array(built, "edge_normals").numpy().any(axis=1))) == {0, *torn}
        expected = exact(s, u, sorted({0, *torn}), "normal", lost=zip(i, members[i, k], strict=True))
        assert found == pytest.approx(expected, abs=1e-10 * np.abs(expected).max())
        # A point without a bond has no plane and no force.
        alive = built.law.intact.numpy()
        alive[:] = 0
        built.law.intact.assign(alive)
        assert (force(built, u) == 0.0).all()
    finally:
        built.law.intact.assign(whole)


def names_of(built):
    return {use.name for use in built.context.fields} | {
        name for launches in built.context.stages.values() for launch in launches for name in launch.parts
    }


def test_the_plan_has_it_only_where_a_scene_asks():
    ours = {"edge_normals", "add_boundary_force", "external", "begin_loads"}
    law = BondAssociated(NeoHookean(1e3, 1e5), weights="plain")
    bare = Simulation(square(9), law, Explicit(1.0)).build("cpu")
    assert not names_of(bare) & (ours | {"edge_points", "edge_reach", "edge_mask"})
    assert names_of(built_on()) >= ours | {"edge_points", "edge_reach"} and "edge_mask" not in names_of(built_on())
    breakable = names_of(built_on("lattice", points=(0,), breakable=True))
    assert breakable >= ours | {"edge_mask"} and not breakable & {"edge_points", "edge_reach"}
    # Where nothing breaks, the launches leave the inside of the sheet alone.
    built = built_on()
    launches = {launch.name: launch.threads for launch in built.context.stages["step"]}
    assert launches["edge_normals"] == len(near_edges(built.simulation.sheet, built.law.families.horizon))
    assert launches["edge_normals"] <= launches["add_boundary_force"] <= built.simulation.sheet.size


def test_the_forms_do_not_share_a_module():
    assert built_on("lattice", "normal").context.module != built_on("lattice", "printed").context.module


def test_a_run_keeps_its_energy_balance():
    """Its work is external work, to the second order of the time step."""
    sheet = square(9)
    start = lifted(sheet, 0, 0.3 * sheet.spacing) + lifted(sheet, sheet.size - 1, -0.2 * sheet.spacing)
    law = BondAssociated(NeoHookean(1e3, 1e5), weights="plain")
    errors = []
    for safety in (0.2, 0.1):
        result = Simulation(
            sheet, law, Explicit(0.05, frames=10, safety=safety), loads=[BoundaryForce(1e13), Fixed([40])],
            initial_displacement=start,
        ).run(device="cpu", precision=64)  # fmt: skip
        energy = result.history[-1]["strain"] + result.history[-1]["kinetic"]
        assert result.history[-1]["external"] > 0.5 * energy
        errors.append(max(abs(row["balance_error"]) for row in result.history[1:]))
    assert errors[1] < 5e-3
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.3)


def test_quasi_static_rest_with_it():
    """A sheet under pressure comes to rest, its edges a little stiffer and its middle where it was."""
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


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"value": -1.0}, "BoundaryForce.value = -1.0: allowed is 0 or"),
        ({"value": float("nan")}, "BoundaryForce.value = nan: allowed is a finite"),
        ({"value": "much"}, "BoundaryForce.value = 'much': allowed is a number"),
        ({"value": 1.0, "form": "norml"}, "did you mean 'normal'"),
    ],
)
def test_wrong_input_is_one_line(arguments, message):
    with pytest.raises(InputError) as error:
        BoundaryForce(**arguments)
    assert message in str(error.value) and "\n" not in str(error.value)


@pytest.mark.parametrize(
    ("loads", "message"),
    [
        ([BoundaryForce(1.0, points=[81])], "BoundaryForce.points holds point 81: allowed are 0 to 80"),
        ([BoundaryForce(1.0, points=[])], "allowed is at least one point"),
        ([BoundaryForce(1.0), BoundaryForce(2.0)], "loads holds 2 of BoundaryForce"),
    ],
)
def test_wrong_points_are_one_line(loads, message):
    with pytest.raises(InputError) as error:
        Simulation(square(9), BondAssociated(NeoHookean(1e3, 1e5)), Explicit(1.0), loads=loads).build("cpu")
    assert message in str(error.value) and "\n" not in str(error.value)


# Distance from the local plane ---------------------------------------------------------------------------


def distance(built, displacement, points):
    return distance_from_local_plane(built, SimpleNamespace(displacement=displacement), points)


@pytest.mark.parametrize("sheet", ["lattice", "jittered"])
def test_off_plane_is_zero_on_a_plane_in_space(sheet):
    built = built_on(sheet)
    s = built.simulation.sheet
    u = uniform(s, random_gradient(5)) + (3.0, -2.0, 1.0)
    assert distance(built, u, np.arange(s.size)).max() < 1e-14


@pytest.mark.parametrize("sheet", ["lattice", "jittered"])
def test_off_plane_is_the_height_of_a_lifted_point(sheet):
    built = built_on(sheet)
    s = built.simulation.sheet
    rotation = rotation_of(6)
    for point, height in ((0, 0.02), (40, -0.003)):
        u = turned(s, lifted(s, point, height), rotation)
        # In the order asked for, and not sorted.
        assert distance(built, u, [point, s.size - 1])[0] == pytest.approx(abs(height), rel=1e-10)
        assert distance(built, u, [s.size - 1, point])[1] == pytest.approx(abs(height), rel=1e-10)
        assert distance(built, u, s.size - 1) == pytest.approx([0.0], abs=1e-14)


def test_off_plane_is_second_order_on_a_curved_surface():
    found = []
    for points in (9, 17, 33):
        sheet = square(points)
        built = SimpleNamespace(
            simulation=SimpleNamespace(sheet=sheet),
            force=SimpleNamespace(families=build_families_of(sheet, HORIZON), alive=None),
        )
        u = np.zeros((sheet.size, 3))
        u[:, 2] = 2.0 * (sheet.points[:, 0] ** 2 - 0.5 * sheet.points[:, 1] ** 2)
        found.append(distance(built, u, [0, sheet.nearest(0.05, 0.05)]))
    ratios = np.array(found[:-1]) / np.array(found[1:])
    assert (np.array(found) > 0.0).all()
    assert ratios == pytest.approx(4.0, rel=0.1)


def test_off_plane_follows_the_standing_bonds():
    built = built_on("lattice", points=(0,), breakable=True)
    s = built.simulation.sheet
    whole = built.law.intact.numpy().copy()
    # Two leaves, one raised: each is a plane of its own once the bonds between them are gone.
    u = np.zeros((s.size, 3))
    u[s.points[:, 1] > 0.0444, 2] = 0.01
    near = s.nearest(0.05, 0.05)
    assert distance(built, u, near)[0] > 1e-3
    try:
        sever(built, ((-0.01, 0.0444), (0.11, 0.0444)))
        assert distance(built, u, near)[0] < 1e-15
        built.law.intact.assign(np.zeros_like(whole))
        assert np.isnan(distance(built, u, near)).all()
    finally:
        built.law.intact.assign(whole)


def test_off_plane_refuses_points_that_do_not_exist():
    built = built_on()
    with pytest.raises(InputError, match="points holds point 81"):
        distance(built, np.zeros((81, 3)), [81])
