"""Supports: prescribed motion, component by component, corners that two motions share, and supports that turn.

A hub that turns in an annulus is compared with the exact membrane: with one whose energy is the least among all
displacements that are the same all around (`torque_of_annulus`).
"""

import numpy as np
import pytest
from helpers import NEO, array, refused, square
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation
from small_runs import run

from warp_pd import (
    BodyForce,
    BondAssociated,
    Circle,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    Newton,
    Pressure,
    Reaction,
    Relaxation,
    Sheet,
    Simulation,
    TensionField,
)
from warp_pd.measures import support_force, support_torque


def test_prescribed_motion_follows_its_knots_component_by_component():
    sheet = square(7)
    right = sheet.edges("right")
    result = run(
        sheet,
        solver=Explicit(0.4, frames=8, safety=0.1),
        loads=[Fixed(sheet.edges("left")), Motion(right, [0.0, 0.1, 0.2, 0.3], x=[0.0, 0.01, 0.01, -0.005], z=0.002)],
    )
    assert result.frame.displacement[right, 0] == pytest.approx(-0.005, abs=1e-12)
    assert result.frame.displacement[right, 2] == pytest.approx(0.002, abs=1e-12)
    assert np.ptp(result.frame.displacement[right, 1]) > 1e-8
    assert abs(result.history[-1]["balance_error"]) < 2e-2


def test_edges_that_move_in_different_directions_share_their_corners():
    """Each point has one row: two would write its velocity at once, and one motion would be lost."""
    sheet = square(7)
    right, top = sheet.edges("right"), sheet.edges("top")
    loads = [
        Fixed(sheet.edges("left")),
        Motion(right, [0.0, 0.1], x=[0.0, 0.01]),
        Motion(top[1:], [0.0, 0.1], y=[0.0, 0.02]),
    ]
    simulation = Simulation(sheet, BondAssociated(NEO), Explicit(0.1, frames=1, safety=0.1), loads=loads)
    built = simulation.build("cpu")
    assert (array(built, "moved_rows").numpy() >= 0).sum() == len(right) + len(top) - 2
    assert len(array(built, "moved_schedules")) == len(right) + len(top) - 2
    corner = np.intersect1d(right, top)
    assert simulation.run(device="cpu").frame.displacement[corner, :2] == pytest.approx(
        np.array([[0.01, 0.02]]), abs=1e-7
    )


def test_points_with_paths_of_their_own_stretch_a_sheet_uniformly():
    """One motion of the whole rim, in the order in which the points are given; what moves alike shares a schedule."""
    sheet = square(7)
    rim = sheet.edges("all")[::-1]
    places = sheet.points[rim, :2]
    paths = np.stack([0.0 * places, 0.2 * places * (1.0, -0.5), 0.3 * places * (1.0, -0.5)])
    motion = Motion(rim, [0.0, 0.5, 1.0], x=paths[..., 0], y=paths[..., 1], z=0.0)
    assert len(motion.constraints(sheet)) == len(np.unique(places.round(9), axis=0)) == len(rim)
    result = run(sheet, Newton(load_steps=2), loads=[motion], weights="corrected")
    wanted = 0.3 * sheet.points[:, :2] * (1.0, -0.5)
    assert result.frame.displacement[:, :2] == pytest.approx(wanted, abs=1e-9)
    pulled = Motion(
        sheet.edges("right"), [0.0, 0.4], x=np.tile([[0.0], [0.01]], 7), z=np.linspace(0, 1e-3, 7) * [[0], [1]]
    )
    result = run(sheet, Explicit(0.4, frames=2), loads=[Fixed(sheet.edges("left")), pulled])
    moved = result.frame.displacement[sheet.edges("right")]
    assert moved[:, 0] == pytest.approx(0.01, abs=1e-9)
    assert moved[:, 2] == pytest.approx(np.linspace(0, 1e-3, 7), abs=1e-9)


def turned_places(places, angle, axis, about):
    turn = Rotation.from_rotvec(angle * np.asarray(axis) / np.linalg.norm(axis))
    return turn.apply(places - about) + about


def test_a_stretched_sheet_whose_edges_turn_together_turns_as_a_whole():
    """Objectivity, whatever the axis, with a translation: the sheet was stretched before it was clamped."""
    sheet, axis, about = square(7).prestretched(1.1), (1.0, 2.0, -1.0), (0.1, 0.0, 0.02)
    edges = sheet.edges("all")
    motion = Motion(edges, [0.0, 1.0], x=[0.0, 0.03], angle=[0.0, 2.0], axis=axis, about=about)
    result = run(sheet, Newton(load_steps=8), loads=[motion], weights="corrected")
    expected = turned_places(sheet.positions, 2.0, axis, about) + (0.03, 0.0, 0.0)
    assert sheet.positions[edges] + result.frame.displacement[edges] == pytest.approx(expected[edges], abs=1e-12)
    assert sheet.positions + result.frame.displacement == pytest.approx(expected, abs=1e-8)
    energies = [row["strain"] for row in result.history]
    assert energies == pytest.approx([energies[0]] * 9, rel=1e-9)


@pytest.mark.parametrize("precision", [32, 64])
def test_an_edge_turns_by_a_full_turn_in_dynamics_with_its_energy(precision):
    sheet = Sheet.rectangle(0.1, 0.02, thickness=1e-3, density=1000.0, points=21)
    right, about, axis = sheet.edges("right"), (0.1, 0.01), (1.0, 0.0, 0.0)
    loads = [
        Fixed(sheet.edges("left")),
        Motion(right, [0.0, 1.0], x=[0.0, 0.01], angle=[0.0, 2.0 * np.pi], about=about, axis=axis),
    ]
    result = run(sheet, Explicit(1.0, frames=4, damping=20.0), loads=loads, precision=precision)
    moved = np.tile([0.01, 0.0, 0.0], (len(right), 1))
    assert result.frame.displacement[right] == pytest.approx(moved, abs=1e-7 if precision == 32 else 1e-12)
    half = result.history[2]
    assert half["strain"] > 1e-6 and abs(result.history[-1]["balance_error"]) < 1e-3


def test_the_torque_of_a_turning_support_is_the_slope_of_the_energy():
    sheet = Sheet.rectangle(0.1, 0.03, thickness=1e-3, density=1000.0, points=17)
    right, about, axis = sheet.edges("right"), (0.1, 0.015, 0.0), (1.0, 0.0, 0.0)

    def twisted(angle):
        pull = Motion(right, [0.0, 1.0], x=[0.0, 0.02], angle=[0.0, angle], about=about, axis=axis)
        return run(sheet, Newton(load_steps=4), loads=[Fixed(sheet.edges("left")), pull])

    before, here, after = (twisted(angle) for angle in (1.99, 2.0, 2.01))
    slope = (after.history[-1]["strain"] - before.history[-1]["strain"]) / 0.02
    # The centre of the edge, about which it turns, has moved with it.
    torque = support_torque(here.built, right, (0.12, 0.015, 0.0))
    assert torque[0] == pytest.approx(slope, rel=1e-5) and slope > 1e-6
    force, shift = support_force(here.built, right), np.array([0.3, -0.2, 0.5])
    moved = support_torque(here.built, right, (0.12, 0.015, 0.0) + shift)
    assert moved == pytest.approx(torque - np.cross(shift, force), rel=1e-9) and force[0] > 0.0


INNER, OUTER, THICKNESS = 0.02, 0.05, 1e-3


def torque_of_annulus(angle, mu, wrinkles, cells):
    """Torque [N m] on the hub of an incompressible neo-Hookean annulus, both rims clamped, that turns by `angle` [rad].

    The radii r and angles q of circles R are found by the least energy; C has the entries r'^2 + (r q')^2,
    r^2 q' / R and (r / R)^2. A membrane that wrinkles has the energy of uniaxial tension where its width falls below.
    """
    R = np.linspace(INNER, OUTER, cells + 1)
    middle, step = 0.5 * (R[1:] + R[:-1]), np.diff(R)
    weight = 2.0 * np.pi * THICKNESS * middle * step

    def density(C11, C12, C22):
        mean, apart = 0.5 * (C11 + C22), np.sqrt((0.5 * (C11 - C22)) ** 2 + C12**2)
        large, small = mean + apart, np.maximum(mean - apart, 1e-6)
        taut = 0.5 * mu * (large + small + 1.0 / (large * small) - 3.0)
        return np.where(wrinkles & (small < large**-0.5), 0.5 * mu * (large + 2.0 * large**-0.5 - 3.0), taut)

    def strains(r, q):
        across, turn, here = np.diff(r) / step, np.diff(q) / step, 0.5 * (r[1:] + r[:-1])
        C = np.array([across**2 + (here * turn) ** 2, here**2 * turn / middle, (here / middle) ** 2])
        return across, turn, here, C

    def energy(x):
        r, q = (
            np.concatenate([[INNER], INNER * x[: cells - 1], [OUTER]]),
            np.concatenate([[angle], x[cells - 1 :], [0.0]]),
        )
        across, turn, here, C = strains(r, q)
        h = 1e-6
        d11, d12, d22 = (
            (density(*(C + h * one[:, None])) - density(*(C - h * one[:, None]))) / (2.0 * h) * weight
            for one in np.eye(3)
        )
        of_across = 2.0 * across * d11 / step
        of_turn = (2.0 * here**2 * turn * d11 + here**2 / middle * d12) / step
        of_here = 0.5 * (2.0 * here * turn**2 * d11 + 2.0 * here * turn / middle * d12 + 2.0 * here / middle**2 * d22)
        by_r, by_q = np.zeros(cells + 1), np.zeros(cells + 1)
        by_r[1:] += of_across + of_here
        by_r[:-1] += of_here - of_across
        by_q[1:] += of_turn
        by_q[:-1] -= of_turn
        scale = mu * THICKNESS * OUTER**2
        slopes = np.concatenate([INNER * by_r[1:-1], by_q[1:-1]]) / scale
        return (density(*C) * weight).sum() / scale, slopes, by_q[0]

    start = np.concatenate(
        [R[1:-1] / INNER, angle * (1.0 / R**2 - 1.0 / OUTER**2)[1:-1] / (1.0 / INNER**2 - 1.0 / OUTER**2)]
    )
    found = minimize(
        lambda x: energy(x)[:2], start, jac=True, method="L-BFGS-B",
        options={"maxiter": 50_000, "maxfun": 100_000, "ftol": 1e-16, "gtol": 1e-9, "maxcor": 50},
    )  # fmt: skip
    return energy(found.x)[2]


@pytest.mark.parametrize(
    ("wrinkles", "angle", "bound"), [(False, 0.2, 2e-3), (True, 0.6, 1e-2)], ids=["plane", "wrinkled"]
)
def test_the_torque_on_a_hub_is_that_of_the_exact_membrane(wrinkles, angle, bound):
    mu = 1e5
    sheet = Sheet.outline(
        Circle((0.0, 0.0), OUTER), holes=[Circle((0.0, 0.0), INNER)], spacing=2e-3, thickness=THICKNESS, density=1000.0
    )
    hub, rim = sheet.within((0.0, 0.0), INNER + 1e-9), sheet.where(lambda x, y: np.hypot(x, y) > OUTER - 1e-9)
    material = MooneyRivlin(c10=0.5 * mu)
    simulation = Simulation(
        sheet,
        BondAssociated(TensionField(material) if wrinkles else material, horizon=1.5),
        Relaxation(load_steps=2) if wrinkles else Newton(load_steps=2),
        loads=[Fixed(rim), Fixed(range(sheet.size), "z"), Motion(hub, [0.0, 1.0], angle=[0.0, angle])],
    )
    result = simulation.run(device="cpu")
    assert result.status == "finished"
    torque = support_torque(result.built, hub)[2]
    # Of second order in the cells: together they are within 1e-6 of what 200 cells and more converge to.
    coarse, fine = (torque_of_annulus(angle, mu, wrinkles, cells) for cells in (25, 50))
    assert torque == pytest.approx(fine + (fine - coarse) / 3.0, rel=bound)


# Loads on held points -----------------------------------------------------------------------------------


@pytest.mark.parametrize("prestretch", [None, 1.1])
@pytest.mark.parametrize("load", ["follower", "dead", "gravity"])
def test_reactions_of_all_supports_balance_all_loads(load, prestretch):
    """At equilibrium the supports carry what acts on the sheet, also on their own points."""
    sheet = square(11)
    if prestretch:
        sheet = sheet.prestretched(prestretch)
    rims = [sheet.edges("left"), np.setdiff1d(sheet.edges("all"), sheet.edges("left"))]
    loads = {
        "follower": Pressure(100.0), "dead": Pressure(100.0, follower=False), "gravity": BodyForce((0.0, 0.0, 1e5))
    }  # fmt: skip
    result = Simulation(
        sheet, BondAssociated(MooneyRivlin(2e5)), Newton(), loads=[
            *(Fixed(rim) for rim in rims), loads[load], *(Reaction(rim, f"rim_{k}") for k, rim in enumerate(rims))
        ],
    ).run(device="cpu")  # fmt: skip
    row, context = result.history[-1], result.built.context
    applied = result.built.to_numpy(context.state.external)[:, 2].sum()
    assert row["rim_0_z"] + row["rim_1_z"] == pytest.approx(-applied, rel=1e-6)
    area, volume = 0.1 * 0.1, 0.1 * 0.1 * 1e-3 / (1.0 if prestretch is None else prestretch**2)
    exact = {"follower": 100.0 * area, "dead": 100.0 * area, "gravity": 1e5 * volume}[load]
    assert applied == pytest.approx(exact, rel=1e-3 if load == "follower" else 1e-12)
    found = [support_force(result.built, rim)[2] for rim in rims]
    assert found == pytest.approx([row["rim_0_z"], row["rim_1_z"]], rel=1e-12)


def test_reaction_in_dynamics_includes_the_load_on_held_points():
    sheet = square(9)
    rim = sheet.edges("all")
    result = Simulation(
        sheet, BondAssociated(MooneyRivlin(2e5)), Explicit(0.4, frames=2, damping=300.0),
        loads=[Fixed(rim), BodyForce((0.0, 0.0, 1e4)), Reaction(rim, "rim")],
    ).run(device="cpu")  # fmt: skip
    assert result.history[-1]["rim_z"] == pytest.approx(-1e4 * 0.1 * 0.1 * 1e-3, rel=1e-4)


def test_components_that_nothing_holds_have_no_reaction():
    sheet = square(7)
    right = sheet.edges("right")
    stretched = sheet.positions * [0.1, 0.0, 0.0]
    result = Simulation(
        sheet, BondAssociated(MooneyRivlin(2e5)), Explicit(1e-3, frames=1), initial_displacement=stretched,
        loads=[Fixed(sheet.edges("left")), Fixed(right, "x"), Reaction(right, "pull")],
    ).run(device="cpu")  # fmt: skip
    assert result.history[-1]["pull_x"] > 0.0
    assert result.history[-1]["pull_y"] == 0.0 and result.history[-1]["pull_z"] == 0.0


def test_reaction_of_points_that_nothing_holds_is_refused():
    sheet = square(9).inclusion((0.05, 0.05), 0.02)
    left, inside = sheet.edges("left"), sheet.inclusions[0]
    law = BondAssociated(MooneyRivlin(2e5))
    for points, said in ((sheet.edges("right"), "nothing holds them"), (inside, "in a rigid inclusion")):
        with refused(said):
            Simulation(sheet, law, Explicit(1e-3), loads=[Fixed(left), Reaction(points)]).build("cpu")
    built = Simulation(sheet, law, Explicit(1e-3), loads=[Fixed(left)]).build("cpu")
    with refused("points: expected points of a Fixed or a Motion, but nothing holds them"):
        support_force(built, sheet.edges("right"))
    with refused("nothing holds them"):
        support_torque(built, sheet.edges("right"))
