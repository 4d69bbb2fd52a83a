"""Visco-hyperelastic laws: the convolution, relaxation, dissipation, momentum, the published force of a bond."""

import numpy as np
import pytest
from helpers import build, internal_force, jittered, square, uniform
from scipy.integrate import cumulative_trapezoid
from visco_laws import LAWS, POLYUREA, TERMS, flight, virial
from visco_laws import build as build_visco

from warp_pd import Explicit, Fixed, Prony, Simulation, Visco, ViscoBondBased, Yeoh


def second_stress(c10, c20, x, y):
    """S11 of the incompressible Yeoh sheet at stretches x, y."""
    third = 1.0 / (x * y)
    return 2.0 * (c10 + 2.0 * c20 * (x**2 + y**2 + third**2 - 3.0)) * (1.0 - third**2 / x**2)


def exact_convolution(terms, rate, duration, points=200_001):
    """S11 of S_inf + sum_p integral exp(-(t - t') / theta_p) dS_p, stretch 1 + rate t along x, width held."""
    t = np.linspace(0.0, duration, points)
    x = 1.0 + rate * t
    total = second_stress(POLYUREA.c10, POLYUREA.c20, x, 1.0)
    speed = rate * np.sqrt(4.0 * x**2 + 4.0 * x**-6)
    for term in terms:
        _, _, time, exponent = term.constants
        clock = cumulative_trapezoid(speed**exponent / time, t, initial=0.0)
        slope = np.gradient(second_stress(term.c10, term.c20, x, 1.0), t)
        total += np.exp(-clock) * cumulative_trapezoid(np.exp(clock) * slope, t, initial=0.0)
    return t, x * total


@pytest.mark.parametrize("rate", [0.15, 1.5, 15.0])
@pytest.mark.parametrize(
    "terms", [TERMS, (Prony(0.1e6, 0.01e6, time=0.5, exponent=0.6),)], ids=["constant times", "rate-dependent time"]
)
def test_rate_dependence_is_that_of_the_exact_convolution(terms, rate):
    duration = 1.5 / rate
    result = flight(Visco(POLYUREA, horizon=2.015, prony=terms), (rate, 0.0), duration)
    t, expected = exact_convolution(terms, rate, duration)
    found = np.array([row["xx"] for row in result.history])
    wanted = np.interp([row["time"] for row in result.history], t, expected)
    assert wanted[-1] > 1.02 * np.interp(duration, t, exact_convolution((), rate, duration)[1])
    # 0.5 % was asked for.
    assert np.abs(found[1:] / wanted[1:] - 1.0).max() < 1e-4


@pytest.mark.parametrize("precision", [32, 64])
def test_relaxation_at_constant_stretch_is_the_prony_series(precision):
    """The sheet is brought to the stretch of the start at once, whatever the step."""
    result = flight(
        Visco(POLYUREA, horizon=2.015, prony=TERMS), (0.0, 0.0), 2.0, steps=4000, start=(1.8, 0.9), precision=precision
    )
    for row in result.history:
        expected = second_stress(POLYUREA.c10, POLYUREA.c20, 1.8, 0.9)
        for term in TERMS:
            expected += np.exp(-row["time"] / term.time) * second_stress(term.c10, term.c20, 1.8, 0.9)
        assert row["xx"] == pytest.approx(1.8 * expected, rel=1e-7 if precision == 64 else 2e-5)


def test_at_once_it_is_the_elastic_sheet_of_all_terms():
    sheet = jittered(9)
    u = uniform(sheet, [[1.3, 0.1], [0.0, 1.2], [0.2, 0.0]])
    u[:, 2] += 0.02 * sheet.points[:, 0] ** 2 / 0.1
    visco = build_visco(sheet, Visco(POLYUREA, horizon=2.015, prony=TERMS))
    elastic = build(sheet, material=Yeoh(0.3496e6, 0.0270e6), horizon=2.015, weights="corrected", law={"fast": False})
    wanted = internal_force(elastic, u)
    np.testing.assert_allclose(internal_force(visco, u), wanted, atol=1e-9 * np.abs(wanted).max())


@pytest.mark.parametrize("seed", [0, 1])
def test_dissipation_is_never_negative_and_energy_balances(seed):
    """Free oscillations at large strains, with terms faster and slower than they are."""
    sheet = square(9)
    rng = np.random.default_rng(seed)
    F = rng.uniform(-0.5, 0.5, (2, 3))
    velocity = 60.0 * sheet.points @ F + 0.2 * rng.normal(size=(sheet.size, 3))
    velocity[sheet.edges("left")] = 0.0
    material = Yeoh(500.0, 100.0)
    terms = (Prony(500.0, 200.0, time=0.02), Prony(300.0, time=0.5), Prony(300.0, time=0.05, exponent=0.3))
    result = Simulation(
        sheet,
        Visco(material, horizon=2.015, weights="plain", prony=terms),
        Explicit(0.4, frames=60, safety=0.1),
        loads=[Fixed(sheet.edges("left"))],
        initial_velocity=velocity,
    ).run(device="cpu", precision=64)
    assert result.status == "finished"
    lost = np.array([row["viscous"] for row in result.history])
    scale = result.history[0]["kinetic"]
    assert lost[-1] > 0.3 * scale
    assert np.diff(lost).min() > -1e-6 * scale
    assert max(abs(row["balance_error"]) for row in result.history) < 2e-3
    assert min(row["strain"] for row in result.history) >= 0.0


def test_nothing_is_lost_on_the_way_to_the_initial_displacement():
    """Also by terms that the speed of a jump would relax at once; and none of it depends on the step."""
    sheet = square(7)
    terms = (Prony(0.1e6, 0.01e6, time=0.5), Prony(0.05e6, time=0.1, exponent=1.6665))
    losses = []
    for safety in (0.4, 0.05):
        result = Simulation(
            sheet,
            Visco(POLYUREA, horizon=2.015, prony=terms),
            Explicit(0.3, frames=10, safety=safety),
            loads=[Fixed(sheet.edges("all"))],
            initial_displacement=uniform(sheet, [[1.5, 0.1], [0.0, 0.9], [0.0, 0.0]]),
        ).run(device="cpu", precision=64)
        assert result.status == "finished"
        first, last = result.history[0], result.history[-1]
        assert abs(first["viscous"]) < 1e-6 * first["strain"]
        assert last["viscous"] > 0.01 * first["strain"]
        assert max(abs(row["balance_error"]) for row in result.history) < 1e-3
        losses.append(last["viscous"])
    assert losses[0] == pytest.approx(losses[1], rel=2e-3)


@pytest.mark.parametrize("law", LAWS)
@pytest.mark.parametrize("cloud", [False, True])
def test_momentum_is_conserved(law, cloud):
    sheet = jittered(7) if cloud else square(7)
    velocity = np.random.default_rng(0).normal(size=(sheet.size, 3))
    built = build_visco(sheet, LAWS[law], initial_velocity=velocity)
    built.context.run("setup")
    built.state.step.assign(np.array([1e-5]))
    steps = built.context.sequence("step")
    mass = built.to_numpy(built.state.mass)[:, None]
    before = (mass * velocity).sum(axis=0)
    for _ in range(300):
        steps.run()
    after = built.to_numpy(built.state.velocity)
    assert np.isfinite(after).all() and np.abs(after - velocity).max() > 0.1
    assert np.abs((mass * after).sum(axis=0) - before).max() < 1e-12 * (mass * np.abs(after)).sum()


def test_only_the_published_law_pulls_on_an_undeformed_sheet():
    sheet = square(9)
    zero = np.zeros((sheet.size, 3))
    for law, stress in (("stress-free", 0.0), ("published", 2.0 * POLYUREA.c10)):
        built = build_visco(sheet, LAWS[law])
        internal_force(built, zero)
        assert np.trace(virial(built)) / 2.0 == pytest.approx(stress, rel=1e-12, abs=1e-9)


@pytest.mark.parametrize("rate", [0.15, 1.5, 15.0])
def test_the_published_law_under_equal_stretches_is_its_own_formula(rate):
    """(c10 + 2 c20 J) lambda + sum (c10_p + 2 c20_p J) gamma_p, twice, J = 2 lambda^2 - 2 (VE eqs. 46, 55 and 61)."""
    law = ViscoBondBased(POLYUREA, prony=TERMS, horizon=3.015)
    result = flight(law, (rate, rate), 1.0 / rate, steps=1600)
    for row in result.history:
        stretch = 1.0 + rate * row["time"]
        J = 2.0 * stretch**2 - 2.0
        expected = (POLYUREA.c10 + 2.0 * POLYUREA.c20 * J) * stretch
        for term in TERMS:
            gamma = rate * term.time * (1.0 - np.exp(-row["time"] / term.time))
            expected += (term.c10 + 2.0 * term.c20 * J) * gamma
        assert 0.5 * (row["xx"] + row["yy"]) == pytest.approx(2.0 * expected, rel=1e-7)


def test_the_published_force_of_a_bond_is_that_of_the_paper():
    """Direct sums at the middle of a sheet at horizon 3.015, any uniform deformation, nothing relaxed."""
    sheet = square(13)
    F = np.array([[1.4, 0.2], [0.1, 0.9], [0.3, 0.2]])
    built = build_visco(sheet, ViscoBondBased(POLYUREA, prony=TERMS))
    internal_force(built, uniform(sheet, F))
    i, families = 84, built.law.families
    delta, h, volume = families.horizon, sheet.thickness, sheet.areas[i] * sheet.thickness
    X = families.bonds * delta
    Y = X @ F.T
    length, image = np.linalg.norm(X, axis=1), np.linalg.norm(Y, axis=1)
    w = (delta / length) ** 2
    m = (w * length**2).sum() * volume
    assert m == pytest.approx(np.pi * h * delta**4, rel=0.03)
    J = 2.0 / m * (w * image**2).sum() * volume - 2.0
    assert J == pytest.approx(np.trace(F.T @ F) - 2.0)
    t = 2.0 / m * (POLYUREA.c10 + 2.0 * POLYUREA.c20 * J) * 2.0 * w * image
    gamma = image / length - 1.0
    for term in TERMS:
        t += 2.0 / m * w * (2.0 * length * term.c10 + 4.0 * length * term.c20 * J) * gamma
    expected = (t / image)[:, None] * Y * volume**2
    np.testing.assert_allclose(built.law.bond_force().numpy()[:, i], expected, rtol=1e-10, atol=1e-15)


def test_rate_dependence_is_the_same_in_every_direction_of_the_sheet():
    """Stretched along a diagonal, where the rate is a shear of the axes of the sheet."""
    law = Visco(POLYUREA, horizon=2.015, prony=(Prony(0.1e6, 0.01e6, time=0.5, exponent=0.6),))
    turn = np.array([[np.cos(0.7), -np.sin(0.7)], [np.sin(0.7), np.cos(0.7)]])
    straight = virial(flight(law, np.diag([1.5, -0.3]), 0.5, steps=200).built)
    turned = virial(flight(law, turn @ np.diag([1.5, -0.3]) @ turn.T, 0.5, steps=200).built)
    np.testing.assert_allclose(turn.T @ turned @ turn, straight, atol=1e-9 * np.abs(straight).max())
