"""The bond-based law: force, energy, constants, tangent; Newton and relaxation on what wrinkles, slackens and tears."""

import json

import numpy as np
import pytest
from click.testing import CliRunner
from helpers import array, internal_force, jittered, rough, sever, square, strain_energy, uniform

from warp_pd import (
    Bimodular,
    BodyForce,
    BondAssociated,
    BondBased,
    CriticalStretch,
    Explicit,
    Fixed,
    InputError,
    Motion,
    NeoHookean,
    Newton,
    PointForce,
    Pressure,
    Relaxation,
    Sheet,
    Simulation,
)
from warp_pd.cli import build_scene, main
from warp_pd.solvers.equilibrium import assign

E = 2.0e4
LAWS = {"equal": Bimodular(E), "bimodular": Bimodular(E, 0.2 * E), "membrane": Bimodular(E, 0.0)}
CRACK = ((0.02, 0.048), (0.07, 0.062))
SHEETS = {"lattice": square(11), "cloud": jittered(11), "cells": square(11, centred=True)}


def built(sheet, material=LAWS["equal"], horizon=3.0, precision=64, solver=None, state="plane stress", **parts):
    simulation = Simulation(sheet, BondBased(material, horizon, state), solver or Explicit(1.0), **parts)
    result = simulation.build("cpu", precision)
    result.context.compile()
    return result


def run(sheet, solver, loads, material=LAWS["equal"], horizon=3.0, precision=None, **parts):
    return Simulation(sheet, BondBased(material, horizon), solver, loads=loads, **parts).run(
        device="cpu", precision=precision
    )


def in_plane(sheet, displacement):
    return displacement * (1.0, 1.0, 0.0)


def flat(sheet):
    return Fixed(range(sheet.size), "z")


# Constants ----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("sheet", SHEETS)
@pytest.mark.parametrize("horizon", [1.5, 3.0])
def test_isotropic_strain_has_the_energy_and_stress_of_plane_stress_at_every_point(sheet, horizon):
    sheet, strain = SHEETS[sheet], 1e-6
    part = built(sheet, horizon=horizon, fields=("principal_stress", "wrinkle_level"))
    strain_energy(part, uniform(sheet, (1.0 + strain) * np.eye(3)[:, :2]))
    density = part.law.strain_energy.numpy() / (sheet.areas * sheet.thickness)
    assert density == pytest.approx(E * strain**2 / (1.0 - 1.0 / 3.0), rel=1e-5)
    largest, smallest, _ = part.fields["principal_stress"].numpy().T
    inside = np.linalg.norm(sheet.points - 0.05, ord=np.inf, axis=1) < 0.05 - 2.2 * horizon * sheet.spacing
    if inside.any() and sheet.lattice is not None:
        exact = E * strain / (1.0 - 1.0 / 3.0)
        assert largest[inside] == pytest.approx(exact, rel=1e-5) and smallest[inside] == pytest.approx(exact, rel=1e-5)
    assert (part.fields["wrinkle_level"].numpy() == 0.0).all()


# Energy of a lattice over that of plane stress with Poisson's ratio 1/3, inside: the discrete family is not round.
UNIAXIAL = {1.0: 5.0 / 3.0, 1.5: 0.8856, 2.015: 1.2395, 3.0: 1.0229, 4.0: 1.0248}


@pytest.mark.parametrize("horizon", UNIAXIAL)
def test_uniaxial_strain_has_the_energy_of_the_lattice(horizon):
    sheet, strain = square(25), 1e-6
    part = built(sheet, horizon=horizon)
    strain_energy(part, uniform(sheet, [[1.0 + strain, 0.0], [0.0, 1.0 - strain / 3.0], [0.0, 0.0]]))
    middle = sheet.nearest(0.05, 0.05)
    density = part.law.strain_energy.numpy()[middle] / (sheet.areas[middle] * sheet.thickness)
    assert density == pytest.approx(UNIAXIAL[horizon] * 0.5 * E * strain**2, rel=1e-3)


def test_a_uniformly_strained_bar_is_in_equilibrium_inside_and_carries_its_force():
    sheet = Sheet.line(1.0, 1e-4, density=1000.0, points=30)
    part = built(sheet, state="line")
    force = internal_force(part, np.outer(sheet.points[:, 0], [1e-6, 0.0, 0.0]))
    assert np.abs(force[6:-6]).max() < 1e-10 * E * 1e-4 * 1e-6
    assert force[:6, 0].sum() == pytest.approx(E * 1e-4 * 1e-6, rel=1e-5)


# Force --------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("material", LAWS)
@pytest.mark.parametrize("sheet", SHEETS)
@pytest.mark.parametrize("broken", [False, True])
def test_the_force_is_minus_the_gradient_of_the_energy(sheet, material, broken):
    sheet = SHEETS[sheet]
    part = built(sheet, LAWS[material], damage=CriticalStretch(9.0) if broken else None)
    if broken:
        sever(part, CRACK)
    u = rough(sheet)
    force = internal_force(part, u)
    direction = np.random.default_rng(2).normal(size=u.shape) * sheet.spacing
    step = 1e-6
    difference = (strain_energy(part, u + step * direction) - strain_energy(part, u - step * direction)) / (2.0 * step)
    assert -(force * direction).sum() == pytest.approx(difference, rel=1e-6)
    scale = np.abs(force).sum()
    assert np.abs(force.sum(axis=0)).max() < 1e-14 * scale
    position = np.column_stack([sheet.points, np.zeros(sheet.size)]) + u
    assert np.abs(np.cross(position, force).sum(axis=0)).max() < 1e-14 * scale


def test_lattice_and_cloud_agree_and_the_frame_does_not_matter():
    sheet = square(11)
    u = rough(sheet)
    force = internal_force(built(sheet, LAWS["bimodular"]), u)
    as_cloud = internal_force(built(sheet.as_cloud(), LAWS["bimodular"]), u)
    assert as_cloud == pytest.approx(force, abs=1e-13 * np.abs(force).max())
    rotation, _ = np.linalg.qr(np.random.default_rng(1).normal(size=(3, 3)))
    place = np.column_stack([sheet.points, np.zeros(sheet.size)])
    turned = internal_force(built(sheet, LAWS["bimodular"]), (place + u) @ rotation.T - place)
    assert turned == pytest.approx(force @ rotation.T, abs=1e-12 * np.abs(force).max())


def test_float32_keeps_the_digits_of_small_strains():
    sheet = square(11)
    u = 1e-5 * rough(sheet)
    wide = internal_force(built(sheet, LAWS["bimodular"]), u)
    narrow = internal_force(built(sheet, LAWS["bimodular"], precision=32), u)
    assert narrow == pytest.approx(wide, abs=2e-5 * np.abs(wide).max())


# Tangent ------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("material", LAWS)
@pytest.mark.parametrize("sheet", SHEETS)
@pytest.mark.parametrize("broken", [False, True])
def test_the_tangent_is_the_derivative_of_the_force(sheet, material, broken):
    sheet = SHEETS[sheet]
    part = built(
        sheet, LAWS[material], solver=Newton(), loads=[Fixed(sheet.edges("left"))],
        damage=CriticalStretch(9.0) if broken else None,
    )  # fmt: skip
    if broken:
        sever(part, CRACK)
    tangent = part.newton.tangent
    u, direction = rough(sheet), np.random.default_rng(3).normal(size=(sheet.size, 3)) * sheet.spacing
    direction[sheet.edges("left")] = 0.0
    ends = []
    for sign in (1.0, -1.0):
        assign(tangent.displacement, u + sign * 1e-7 * direction)
        tangent.evaluate()
        ends.append(tangent.residual.numpy().copy())
    assign(tangent.displacement, u)
    tangent.linearise(0.0)
    assign(tangent.vector, direction)
    tangent.run("product")
    product, expected = tangent.image.numpy(), (ends[1] - ends[0]) / 2e-7
    assert product == pytest.approx(expected, abs=1e-6 * np.abs(expected).max())
    sparse = tangent.sparse()
    matrix = sparse.matrix()
    lost = np.zeros(sheet.size, bool)
    if broken:
        lost = (part.law.intact.numpy() == 0).all(axis=0)
    found = matrix @ direction.ravel()[sparse.free]
    assert not lost.any()
    assert found == pytest.approx(product.ravel()[sparse.free], abs=1e-12 * np.abs(product).max())
    assert abs(matrix - matrix.T).max() <= 1e-15 * abs(matrix).max()
    blocks = tangent.inverse_blocks.numpy()
    free = np.flatnonzero(sparse.free.reshape(-1, 3)[:, 0])
    for order in (0, len(free) // 2, len(free) - 1):
        own = matrix[3 * order : 3 * order + 3, 3 * order : 3 * order + 3].toarray()
        assert blocks[free[order]] @ own == pytest.approx(np.eye(3), abs=1e-8)


def beam(ratio=1.0, points=60, load=200.0):
    sheet = Sheet.rectangle(2.0, 0.21, thickness=0.01, density=1000.0, points=points, centred=True)
    pull = PointForce(sheet.edges("right"), (0.0, -load, 0.0), ramp=[(0.0, 0.0), (1.0, 1.0)])
    return sheet, [Fixed(sheet.edges("left")), flat(sheet), pull], Bimodular(3.84e8, 3.84e8 / ratio)


def test_newton_converges_quadratically():
    sheet, loads, material = beam(ratio=5.0)
    result = run(sheet, Newton(tolerance=1e-11), loads, material)
    assert result.status == "finished"
    r = np.array(result.summary["solve"]["residuals"])
    near = np.flatnonzero((r[:-1] < 1e-2) & (r[:-1] > 1e-4))
    assert len(near) >= 1
    # Below 1e-4 the tangent is kept; above, the error squares. A residual is stiff membrane against soft bending,
    # (length over height)^2 apart.
    assert (r[near + 1] < 100.0 * r[near] ** 2).all()


@pytest.mark.parametrize("ratio", [1.0, 5.0])
def test_newton_and_relaxation_agree(ratio):
    sheet, loads, material = beam(ratio, points=40)
    first = run(sheet, Newton(tolerance=1e-11), loads, material)
    second = run(sheet, Relaxation(tolerance=1e-10), loads, material)
    assert first.status == second.status == "finished"
    scale = np.abs(first.frame.displacement).max()
    assert np.abs(first.frame.displacement - second.frame.displacement).max() < 1e-6 * scale


@pytest.mark.parametrize("preconditioner", ["direct", "jacobi"])
def test_pressure_and_free_deflection(preconditioner):
    """Across its plane a flat sheet has no stiffness until it is deflected."""
    sheet = square(13)
    loads = [Fixed(sheet.edges()), Pressure(5.0)]
    newton = run(sheet, Newton(preconditioner=preconditioner), loads)
    relaxed = run(sheet, Relaxation(tolerance=1e-9), loads)
    assert newton.status == relaxed.status == "finished"
    assert newton.frame.displacement[:, 2].max() > 1e-3
    assert newton.frame.displacement == pytest.approx(relaxed.frame.displacement, abs=1e-6 * 0.01)


def test_constant_stiffness_ends_at_the_same_shape_and_never_hangs_where_it_oscillates():
    sheet, loads, material = beam(load=100.0)
    tangent = run(sheet, Newton(load_steps=2), loads, material)
    constant = run(sheet, Newton(load_steps=2, stiffness="constant"), loads, material)
    assert constant.status == "finished"
    assert constant.frame.displacement == pytest.approx(tangent.frame.displacement, abs=1e-6)
    sheet, loads, material = beam(ratio=20.0, load=1000.0)
    lost = run(sheet, Newton(stiffness="constant", most_cuts=1), loads, material)
    assert lost.status == "not converged" and "last good load step" in lost.summary["message"]


def test_load_steps_end_where_one_step_does():
    """The steps after the first start on the line through the two before: a guess, not a part of the answer."""
    sheet, loads, material = beam(ratio=5.0, points=40)
    once, often = (run(sheet, Newton(load_steps=n, tolerance=1e-10), loads, material) for n in (1, 5))
    assert often.frame.displacement == pytest.approx(once.frame.displacement, abs=1e-8)


# Slack and wrinkled -------------------------------------------------------------------------------------


SOLVERS = {"newton": Newton(), "relaxation": Relaxation(most_steps=20_000)}


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("material", LAWS)
def test_a_membrane_without_load_is_at_rest_at_once(solver, material):
    sheet = square(11)
    result = run(sheet, SOLVERS[solver], [Fixed(sheet.edges("left")), flat(sheet)], LAWS[material])
    assert result.status == "finished" and result.summary["residual"] == 0.0
    assert np.abs(result.frame.displacement).max() == 0.0


@pytest.mark.parametrize("solver", SOLVERS)
@pytest.mark.parametrize("free", [False, True], ids=["flat", "free to leave the plane"])
def test_a_fully_wrinkled_membrane_carries_nothing(solver, free):
    """Both ends move inwards: a membrane without compressive modulus gives way and carries no load."""
    sheet = square(11)
    ends = sheet.edges("left", "right")
    inwards = [
        Motion(sheet.edges("left"), [0.0, 1.0], x=[0.0, 0.005], y=0.0),
        Motion(sheet.edges("right"), [0.0, 1.0], x=[0.0, -0.005], y=0.0),
    ]
    held = [Fixed(ends, "z")] if free else [flat(sheet)]
    result = run(sheet, SOLVERS[solver], [*held, *inwards], LAWS["membrane"], fields=("wrinkle_level",))
    assert np.isfinite(result.frame.displacement).all()
    if result.status == "not converged":
        assert "last good load step" in result.summary["message"]
    else:
        reactions = result.built.to_numpy(result.built.state.force)[ends]
        assert np.abs(reactions).sum() < 1e-4 * E * 1e-3 * 0.1 * 0.1
        assert result.frame.point_data["wrinkle_level"].max() > 0.3


def test_the_wrinkling_energy_is_least_at_rest_whichever_solver_finds_it():
    """Its energy is convex: forces and energy at rest are unique, places of slack points are not."""
    sheet = Sheet.rectangle(0.1, 0.05, thickness=1e-3, density=1000.0, points=(21, 11), centred=True)
    top = sheet.edges("top")
    loads = [
        Fixed(sheet.edges("bottom")),
        flat(sheet),
        Motion(top, [0.0, 0.5, 1.0], x=[0.0, 0.0, 2e-3], y=[0.0, 5e-4, 5e-4]),
    ]
    ends = []
    for solver in (Newton(load_steps=2), Relaxation(tolerance=1e-9, load_steps=2)):
        result = run(sheet, solver, loads, LAWS["membrane"], fields=("wrinkle_level",))
        assert result.status == "finished"
        assert 0.2 < result.frame.point_data["wrinkle_level"].mean() < 0.9
        ends.append((result.history[-1]["strain"], *result.built.to_numpy(result.built.state.force)[top].sum(axis=0)))
    assert ends[0] == pytest.approx(ends[1], rel=1e-6, abs=1e-6 * abs(ends[0][1]))


# Rupture ------------------------------------------------------------------------------------------------


def notched(travel=4e-4):
    sheet = Sheet.rectangle(0.1, 0.04, thickness=1e-3, density=1000.0, points=(40, 16), centred=True)
    sheet = sheet.cut((0.05, -1e-3), (0.05, 0.016))
    left, right = sheet.edges("left"), sheet.edges("right")
    loads = [
        flat(sheet),
        Motion(left, [0.0, 1.0], x=[0.0, -travel], y=0.0),
        Motion(right, [0.0, 1.0], x=[0.0, travel], y=0.0),
    ]
    return sheet, loads, np.concatenate([left, right])


@pytest.mark.parametrize("solver", ["newton", "relaxation"])
@pytest.mark.parametrize("strain", [0.012, 0.006], ids=["some", "through"])
def test_bonds_break_at_rest_until_none_is_over_stretched(solver, strain):
    sheet, loads, ends = notched()
    solvers = {"newton": Newton(load_steps=2, tolerance=1e-6), "relaxation": Relaxation(load_steps=2)}
    result = run(sheet, solvers[solver], loads, damage=CriticalStretch(1.0 + strain, spared=ends))
    assert result.status == "finished"
    whole = run(sheet, Newton(), loads)
    force, uncut = (np.abs(r.built.to_numpy(r.built.state.force)[ends]).sum() for r in (result, whole))
    assert 0.1 < result.frame.damage.max() <= 1.0
    assert force < (0.95 if strain == 0.012 else 0.5) * uncut
    before = result.built.law.intact.numpy().copy()
    result.built.context.run("rupture")
    assert (result.built.law.intact.numpy() == before).all()


def test_energy_balances_through_rupture_in_time():
    sheet, loads, ends = notched()
    solver = Explicit(1.0, frames=20, safety=0.3, precision=64)
    result = run(sheet, solver, loads, damage=CriticalStretch(1.008, spared=ends))
    assert result.frame.damage.max() > 0.2
    assert max(abs(row["balance_error"]) for row in result.history) < 0.01


# The scenes' own physics --------------------------------------------------------------------------------


def test_the_bar_meets_the_exact_solution_and_its_error_halves_with_the_spacing():
    for ratio, bound in ((1.0, 4e-3), (5.0, 5e-3), (10.0, 7e-3)):
        errors = []
        for points in (100, 200):
            result = build_scene("bimodular_bar", {"points": points, "ratio": ratio}).run(device="cpu")
            assert result.status == "finished" and result.summary["solve"]["iterations"] <= 5
            errors.append(result.summary["measures"]["displacement_error"]["value"])
        assert errors[1] < bound and errors[1] < 0.6 * errors[0]


def test_a_softer_compressed_side_bends_more():
    small = {"points": 60, "tolerance": 1e-6}
    down = [
        -build_scene("cantilever", {**small, "ratio": ratio}).run(device="cpu").summary["measures"]["end_down"]["value"]
        for ratio in (1.0, 5.0, 20.0)
    ]
    assert down[0] < down[1] < down[2]
    assert down[0] == pytest.approx(0.7690, rel=0.2)


def test_one_spacing_of_horizon_leaves_nothing_wrinkled():
    """The horizon that the paper prints for its square: a net, which turns instead of wrinkling."""
    shares = []
    for horizon in (1.0, 3.0):
        result = build_scene("square_wrinkles", {"points": 20, "horizon": horizon}).run(device="cpu")
        assert result.status == "finished"
        shares.append(result.summary["measures"]["mean_wrinkle_level"]["value"])
    assert shares[0] < 0.02
    assert shares[1] > 0.2


# What is left out, and what is refused ------------------------------------------------------------------


def test_nothing_is_left_for_what_is_not_asked_for():
    sheet = square(9)
    names = {use.name for use in built(sheet).context.fields}
    assert not names & {"principal_stress", "wrinkle_level", "alive", "bond_force", "stencil_common", "kind_shape"}
    assert "wrinkle_level" in {use.name for use in built(sheet, fields=("wrinkle_level",)).context.fields}
    cloud = built(jittered(9))
    assert not {use.name for use in cloud.context.fields} & {"commons", "shapes", "bond_force"}
    assert array(cloud, "weights").shape[1] == 81


LINE = Sheet.line(1.0, 1.0, density=1.0, points=9)
WRONG = [
    (lambda: Bimodular(0.0), "tension"),
    (lambda: Bimodular(1.0, -1.0), "compression"),
    (lambda: BondBased(LAWS["equal"], horizon=0.0), "horizon"),
    (lambda: BondBased(LAWS["equal"], state="plane strain"), "did you mean 'plane stress'"),
    (lambda: built(square(9), horizon=0.9), "horizon = 0.9"),
    (lambda: built(square(9), state="line"), "state = 'line'"),
    (lambda: built(LINE), "state = 'plane stress'"),
    (lambda: built(square(9), fields=("stress",)), "fields = 'stress'"),
    (
        lambda: Simulation(square(9), BondAssociated(NeoHookean(1.0, 1.0)), Explicit(1.0), fields=("stress",)).build(
            "cpu"
        ),
        "fields = ['stress']",
    ),
    (lambda: Newton(stiffness="secant"), "stiffness = 'secant'"),
    (
        lambda: Simulation(
            square(9), BondAssociated(NeoHookean(1.0, 1.0)), Newton(stiffness="constant")
        ).build("cpu"),
        "stiffness = 'constant'",
    ),
    (lambda: built(square(25), solver=Newton(preconditioner="multigrid")), "preconditioner = 'multigrid'"),
    (lambda: build_scene("notched_strip", {"start": 1.0}), "start = 1.0"),
    (lambda: build_scene("cantilever", {"ratio": 0.0}), "ratio = 0.0"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_input_is_one_line(make, text):
    with pytest.raises(InputError) as error:
        make()
    assert text in str(error.value) and "\n" not in str(error.value)


def test_no_convergence_keeps_the_last_good_load_step_and_ends_with_code_3(tmp_path):
    command = [
        "run", "cantilever", "--points", "40", "--set", "ratio=20", "--set", "stiffness=constant", "--set",
        "most_cuts=0", "--device", "cpu", "--quiet", "--no-usd", "--no-pictures", "--out", str(tmp_path),
    ]  # fmt: skip
    done = CliRunner().invoke(main, command)
    assert done.exit_code == 3 and "last good load step" in done.output
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "not converged" and 0.0 < summary["solve"]["reached"] < 1.0


def test_gravity_on_float32_bar():
    sheet = Sheet.line(1.0, 1e-4, density=1000.0, points=30)
    loads = [Fixed([0]), Fixed(range(30), "yz"), BodyForce((-9.81e3, 0.0, 0.0))]
    ends = []
    for precision in (32, 64):
        result = Simulation(sheet, BondBased(LAWS["equal"], state="line"), Newton(), loads=loads).run(
            device="cpu", precision=precision
        )
        assert result.status == "finished"
        ends.append(result.frame.displacement)
    assert ends[0] == pytest.approx(ends[1], abs=1e-4 * np.abs(ends[1]).max())
