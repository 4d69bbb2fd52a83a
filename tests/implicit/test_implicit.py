"""Implicit steps: order two, momentum, energy, periods, slow processes, precision, restarts."""

import numpy as np
import pytest
from helpers import NEO, StopAt, refused, square
from own_parts import recipe
from resumed_runs import restarts_at_every_frame
from scipy.integrate import quad
from small_runs import run, simulate

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    CriticalStretch,
    Explicit,
    Fixed,
    Implicit,
    InputError,
    Joint,
    Maxwell,
    MooneyRivlin,
    Motion,
    NeoHookean,
    Newton,
    Nodal,
    Place,
    PointForce,
    Pressure,
    Prony,
    Reaction,
    SelfContact,
    Simulation,
    TensionField,
    Visco,
    ViscoBondBased,
    Yeoh,
    placed,
    together,
)
from warp_pd.command.modes import natural_modes

SHEET = square(7)
LEFT, RIGHT = SHEET.edges("left"), SHEET.edges("right")
X, Y = SHEET.points.T
VELOCITY = np.stack([0.2 * np.sin(5.0 * np.pi * X), 0.0 * X, 0.0 * X], axis=1)


def swing(steps, **changes):
    """A strip that is struck and swings along its length for 0.2 s."""
    parts = {"initial_velocity": VELOCITY, "loads": [Fixed(LEFT)], **changes}
    solver = {"radius": 1.0, "residual": 1e-9, **changes.pop("solver", {})}
    parts.pop("solver", None)
    return run(SHEET, Implicit(0.2, frames=2, steps=steps, **solver), **parts)


@pytest.mark.parametrize("radius", [1.0, 0.5])
def test_order_two_in_time(radius):
    ends = [swing(steps, solver={"radius": radius}).frame.displacement for steps in (80, 160, 640)]
    errors = [np.abs(end - ends[-1]).max() for end in ends[:2]]
    assert errors[1] < 1e-4
    assert errors[0] / errors[1] == pytest.approx(4.1, rel=0.1)


def test_explicit_and_implicit_steps_agree():
    found = swing(640)
    expected = run(SHEET, Explicit(0.2, frames=2, safety=0.1), initial_velocity=VELOCITY, loads=[Fixed(LEFT)])
    assert np.abs(found.frame.displacement - expected.frame.displacement).max() < 2e-4 * 0.1
    assert abs(found.history[-1]["balance_error"]) < 1e-3


def test_momentum_and_angular_momentum():
    """A free sheet that flies, turns and breathes: momentum to round-off, angular momentum in second order."""
    v = np.stack([0.3 - 4.0 * Y + 1.0 * X, 0.2 + 4.0 * X, 0.1 + 2.0 * X], axis=1)
    mass = 1e-3 * 1000.0 * SHEET.areas[:, None]
    turned = []
    for steps in (50, 100):
        frame = run(SHEET, Implicit(0.2, frames=2, steps=steps, radius=1.0), initial_velocity=v).frame
        np.testing.assert_allclose((mass * frame.velocity).sum(0), (mass * v).sum(0), atol=1e-6 * mass.sum())
        at = SHEET.positions + frame.displacement
        spin, start = (np.cross(p, mass * w).sum(0) for p, w in ((at, frame.velocity), (SHEET.positions, v)))
        turned.append(np.linalg.norm(spin - start) / np.linalg.norm(start))
    assert turned[1] < 1e-3
    assert turned[0] / turned[1] == pytest.approx(4.0, rel=0.3)


def test_energy_over_many_periods():
    """The energy of a radius of 1 does not drift; smaller ones take it from what is not resolved."""
    drum = square(5).prestretched(1.3)
    x, y = drum.positions[:, :2].T
    u = np.zeros((drum.size, 3))
    u[:, 2] = 0.01 * np.sin(np.pi * x / x.max()) * np.sin(np.pi * y / y.max())
    parts = {"initial_displacement": u, "loads": [Fixed(drum.edges("all"))], "weights": "corrected"}
    rows = {
        radius: run(drum, Implicit(4.0, frames=40, steps=1500, radius=radius), **parts).history for radius in (1.0, 0.6)
    }
    begin = rows[1.0][0]["strain"]
    rest = run(drum, Implicit(0.01, frames=1, steps=1), **{**parts, "initial_displacement": None}).history[0]["strain"]
    gained = [(row["strain"] + row["kinetic"] - begin) / (begin - rest) for row in rows[1.0]]
    assert max(np.abs(gained)) < 0.01
    assert abs(np.mean(gained[20:])) < 0.005
    assert rows[0.6][-1]["strain"] + rows[0.6][-1]["kinetic"] < begin


@pytest.mark.parametrize("precision", [32, 64])
def test_period_of_a_drum(precision):
    """30 steps a period, against the frequency of the stiffness matrix: longer by (omega dt)^2 / 12 in theory."""
    drum = square(9).prestretched(1.3)
    clamp = [Fixed(drum.edges("all"))]
    parts = {"loads": clamp, "weights": "corrected"}
    built = simulate(drum, Newton(), **parts).build("cpu", 64)
    built.context.run("start")
    built.context.run("setup")
    mode = natural_modes(built, 1, "z")
    period, middle = 1.0 / mode.frequencies[0], drum.size // 2
    u = 1e-3 * mode.shapes[0] / np.abs(mode.shapes[0]).max()
    solver = Implicit(3.0 * period, frames=90, steps=90, radius=1.0)
    found = simulate(drum, solver, initial_displacement=u, **parts)
    z = []
    watch = type("Watch", (), {"write": lambda s, f: z.append(f.displacement[middle, 2]), "save": lambda s: None,
                               "close": lambda s: None})  # fmt: skip
    assert found.run(device="cpu", precision=precision, writers=[watch()]).status == "finished"
    z, t = np.array(z), solver.duration * np.arange(91) / 90
    before = np.flatnonzero(z[:-1] * z[1:] < 0.0)
    zeros = t[before] - z[before] * (t[before + 1] - t[before]) / (z[before + 1] - z[before])
    longer = 2.0 * np.diff(zeros).mean() / period - 1.0
    assert longer == pytest.approx((2.0 * np.pi / 30.0) ** 2 / 12.0, abs=4e-4)
    assert longer < 0.005


def test_the_frequency_of_a_drum_is_of_second_order_in_the_spacing():
    errors = []
    for points in (11, 21):
        drum = square(points).prestretched(1.3)
        built = simulate(drum, Newton(), loads=[Fixed(drum.edges("all"))], weights="corrected").build("cpu", 64)
        built.context.run("start")
        built.context.run("setup")
        step = 1e-4
        ahead, behind = built.law.energy_density(np.array([[1.3 + step], [1.3 - step]]), np.array([[1.3]]))[:, 0]
        speed = np.sqrt(1.3 * (ahead - behind) / (2.0 * step) / drum.density)
        errors.append(speed / (np.sqrt(2.0) * 0.1) / natural_modes(built, 1, "z").frequencies[0] - 1.0)
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    # 0.17 % with 41 points, 0.07 % with 61.
    assert errors[1] == pytest.approx(4.0 * 0.0017, rel=0.03)


STRETCH, RAMP, TAU, MU = 1.5, 0.5, 0.5, NEO.mu
VISCOUS = {
    "branches": Visco(MooneyRivlin(0.5 * MU, 0.0), horizon=2.015, branches=[Maxwell(0.7 * MU, TAU)]),
    "prony": Visco(MooneyRivlin(0.5 * MU, 0.0), horizon=2.015, prony=[Prony(c10=0.35 * MU, time=TAU)]),
    "wrinkles": Visco(
        TensionField(MooneyRivlin(0.5 * MU, 0.0)), horizon=2.015, branches=[Maxwell(0.7 * MU, TAU)]
    ),
}  # fmt: skip


def relaxing(law, steps, inertia=False, **options):
    """Nominal stress of a strip pulled to a stretch in 0.5 s and held until 2 s, at 9 times."""
    far = 0.1 * (STRETCH - 1.0)
    loads = [
        Fixed(LEFT, "x"), Fixed([0], "y"), Fixed(np.arange(SHEET.size), "z"), Reaction(RIGHT, "pull"),
        Motion(RIGHT, x=(0.0, far, far), times=(0.0, RAMP, 2.0)),
    ]  # fmt: skip
    if law == "wrinkles":
        # The sides come closer than the strip contracts.
        loads[1:2] = [
            Fixed(SHEET.edges("bottom"), "y"), Motion(SHEET.edges("top"), y=(0.0, -0.03, -0.03), times=(0.0, RAMP, 2.0))
        ]  # fmt: skip
    solver = Implicit(2.0, frames=8, steps=steps, inertia=inertia, residual=options.pop("residual", None))
    result = Simulation(square(7, density=1.0), VISCOUS[law], solver, loads=loads).run(device="cpu", **options)
    assert result.status == "finished"
    return np.array([row["pull_x"] for row in result.history]) / (0.1 * 1e-3), result


def exact_stress(law, t):
    """Uniaxial stress at a time, by quadrature of the history."""
    stretch = lambda s: 1.0 + (STRETCH - 1.0) * min(s / RAMP, 1.0)  # noqa: E731
    fading = lambda s: np.exp(-(t - s) / TAU)  # noqa: E731
    parts = ((0.0, min(t, RAMP)), (min(t, RAMP), t))
    over = lambda f: sum(quad(f, a, b, epsabs=1e-12)[0] for a, b in parts if b > a)  # noqa: E731
    at = stretch(t)
    M = [fading(0.0) + over(lambda s, p=p: fading(s) * stretch(s) ** p / TAU) for p in (-2, 1)]
    return MU * (at - at**-2) + 0.7 * MU * (M[0] * at - M[1] / at**2)


@pytest.mark.parametrize("inertia", [False, True])
def test_relaxation_of_a_stretched_strip(inertia):
    """Maxwell elements: C^-1 is not quite linear in a step, which is of second order."""
    wanted = np.array([exact_stress("branches", t) for t in np.linspace(0.0, 2.0, 9)])
    errors = []
    for steps in (40, 80):
        found, result = relaxing("branches", steps, inertia, residual=1e-9)
        errors.append(np.abs(found - wanted)[3:].max() / wanted.max())
    # With inertia the strip still swings a little.
    assert errors[1] < (1e-3 if inertia else 3e-4)
    if not inertia:
        assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
        assert result.history[-1]["viscous"] > 0.0
        assert abs(result.history[-1]["balance_error"]) < 1e-3


def test_wrinkles_relax_in_uniaxial_tension():
    wanted = [exact_stress("branches", t) for t in np.linspace(0.0, 2.0, 9)]
    found, result = relaxing("wrinkles", 80)
    np.testing.assert_allclose(found, wanted, atol=3e-4 * max(wanted))
    assert result.history[-1]["viscous"] > 0.0


def test_prony_terms_in_second_order():
    ends = [relaxing("prony", steps, residual=1e-10)[0] for steps in (40, 80, 320)]
    errors = [np.abs(end - ends[-1])[3:].max() for end in ends[:2]]
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)


def test_single_precision():
    single, double = (relaxing("branches", 40, precision=bits)[0] for bits in (32, 64))
    np.testing.assert_allclose(single, double, atol=2e-4 * double.max())


def test_a_slow_load_without_inertia_ends_as_newton_does():
    loads = [Fixed(SHEET.edges("all")), Pressure(20.0, ramp=((0.0, 0.0), (1.0, 1.0)))]
    found = run(SHEET, Implicit(1.0, frames=2, steps=4, inertia=False, residual=1e-9), loads=loads)
    expected = run(SHEET, Newton(load_steps=2, tolerance=1e-10), loads=loads)
    assert found.status == "finished"
    np.testing.assert_allclose(found.frame.displacement, expected.frame.displacement, atol=1e-8)


def test_steps_adapt_to_a_tolerance():
    """A load that comes in the middle of the run: short steps there alone."""
    loads = [Fixed(LEFT), PointForce(RIGHT, (2e-3, 0.0, 0.0), ramp=((0.0, 0.0), (0.5, 0.0), (0.51, 1.0)))]
    ends = [
        run(SHEET, Implicit(1.0, frames=1, tolerance=tolerance, damping=20.0), loads=loads)
        for tolerance in (1e-2, 1e-3, 1e-4)
    ]
    errors = [np.abs(end.frame.displacement - ends[-1].frame.displacement).max() for end in ends[:2]]
    moved = np.abs(ends[-1].frame.displacement).max()
    assert errors[1] < errors[0] < 0.1 * moved
    steps = [end.summary["steps"] for end in ends]
    assert steps[0] < steps[1] < steps[2] < 2000


def test_steps_adapt_to_a_load_that_grows_from_nothing():
    """The displacement begins with the third power of the time, as the error of a step: no step is short enough."""
    loads = [Fixed(LEFT), PointForce(RIGHT, (2e-3, 0.0, 0.0), ramp=((0.0, 0.0), (0.2, 1.0)))]
    found, expected = (
        run(SHEET, solver, loads=loads)
        for solver in (Implicit(0.2, frames=1, tolerance=1e-4, radius=1.0), Explicit(0.2, frames=1, safety=0.2))
    )
    wanted = expected.frame.displacement
    assert np.abs(found.frame.displacement - wanted).max() < 1e-2 * np.abs(wanted).max()
    assert found.summary["steps"] < 250


@pytest.mark.parametrize("tolerance", [1e-3, 1e-5])
def test_slow_steps_adapt_to_a_motion_that_is_short_beside_the_run(tolerance):
    """A velocity that jumps at the start and at each knot is no error, however short the step."""
    knots = ((0.0, 0.0), (1.0, 0.02), (2000.0, 0.02), (2001.0, 0.01), (3600.0, 0.01))
    move = Motion(RIGHT, times=[t for t, _ in knots], x=[x for _, x in knots], y=0.0, z=0.0)
    law = Visco(NEO, horizon=2.015, branches=[Maxwell(5e2, 600.0)])
    loads = [Fixed(LEFT), move, Reaction(RIGHT, "pull")]
    found, expected = (
        Simulation(SHEET, law, Implicit(3600.0, frames=4, inertia=False, **how), loads=loads).run(
            device="cpu", precision=64
        )
        for how in ({"tolerance": tolerance}, {"steps": 2000})
    )
    assert found.status == "finished"
    pulls = [[row["pull_x"] for row in result.history] for result in (found, expected)]
    np.testing.assert_allclose(*pulls, rtol=2e-3)
    assert found.summary["steps"] < 400


@pytest.mark.parametrize("law", ["branches", "prony"])
@pytest.mark.parametrize(
    "solver",
    [{"steps": 20}, {"tolerance": 1e-3}, {"steps": 20, "inertia": False}, {"tolerance": 1e-3, "inertia": False}],
)
def test_a_run_continues_from_the_middle_bit_for_bit(law, solver, tmp_path):
    def parts(duration, frames):
        return Simulation(SHEET, VISCOUS[law], Implicit(duration, frames=frames, **solver), loads=[
            Fixed(LEFT), Motion(RIGHT, x=(0.0, 0.02), times=(0.0, 0.4)),
        ])  # fmt: skip

    whole = parts(0.4, 4).run(device="cpu", out=tmp_path / "whole", vtkhdf=False)
    scene = parts(0.4, 4)
    from warp_pd.run import recorder

    original = recorder.Recorder.frame

    def stopping(self, index, *rest, **more):
        if index == 2:
            self.stop_asked = True
        original(self, index, *rest, **more)

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder.Recorder, "frame", stopping)
        first = scene.run(device="cpu", out=tmp_path / "part", vtkhdf=False)
    assert first.status == "interrupted"
    rest = scene.run(device="cpu", out=tmp_path / "part", vtkhdf=False, resume=True)
    assert rest.status == "finished"
    np.testing.assert_array_equal(rest.frame.displacement, whole.frame.displacement)
    assert rest.history[-1] == whole.history[-1]


@pytest.mark.parametrize(
    "parts, message",
    [
        ({"damage": CriticalStretch(2.0)}, "not supported by the solver Implicit; expected a TearingEnergy alone, or"),
    ],
)  # fmt: skip
def test_what_implicit_steps_do_not_take_is_refused(parts, message):
    with pytest.raises(InputError, match=message):
        run(SHEET, Implicit(1.0, steps=10), **parts)


@pytest.mark.parametrize(
    ("law", "said"),
    [
        (ViscoBondBased(Yeoh(1e3), prony=[Prony(500.0)]), "not supported by the solver Implicit; expected .*Visco, "),
        (Nodal(Yeoh(1e3)), "not supported by the solver Implicit; expected BondAssociated or Visco, "),
        (Visco(Yeoh(1e3), prony=[Prony(500.0, exponent=0.5)]), r"Prony\.exponent = 0\.5: expected 0, "),
        (BondBased(Bimodular(1e5)), "not supported by the solver Implicit; expected "),
    ],
    ids=["bonds", "nodal", "rates", "elastic bonds"],
)
def test_a_law_that_implicit_steps_do_not_take_is_named_as_the_user_wrote_it(law, said):
    scene = Simulation(SHEET, law, Implicit(1.0, steps=10), loads=[Fixed(LEFT)])
    with refused(match=rf"^force = {type(law).__name__}: {said}[^\n]*Explicit$"):
        scene.build("cpu")


def test_a_tolerance_below_the_round_off_of_the_precision_is_refused():
    simulation = Simulation(SHEET, BondAssociated(NEO), Implicit(1.0, tolerance=1e-8))
    with pytest.raises(InputError, match=r"^tolerance = 1e-08: expected at least 6e-08 in precision 32$"):
        simulation.build("cpu", 32)
    simulation.build("cpu", 64)


def test_a_residual_that_is_round_off_is_reported_as_it_is():
    pull = Motion(RIGHT, (0.0, 0.02), x=(0.0, 0.001), y=0.0, z=0.0)
    for solver in (Implicit(0.02, frames=1, steps=4, residual=1e-8), Newton(tolerance=1e-8, duration=0.02)):
        solve = run(SHEET, solver, loads=[Fixed(LEFT), pull], precision=32).summary["solve"]
        residual = solve["residual"] if "residual" in solve else solve["residuals"][-1]
        assert 1e-8 < residual < 1e-5
    assert solve["load_steps"][0]["lattices"][0]["round_off"]


def test_a_ramp_shorter_than_a_step_is_noted_where_the_balance_is_off():
    sheet = square(13)

    def notes(ramp):
        loads = [Fixed(sheet.edges("all")), Pressure(50.0, ramp=[(0.0, 0.0), (ramp, 1.0)])]
        stiff = NeoHookean(mu=3e5, bulk=1e8)
        found = run(sheet, Implicit(0.2, frames=4, steps=40), material=stiff, loads=loads).summary["notes"]
        return [note for note in found if note.startswith("Implicit: Pressure ramp changes within")]

    (note,) = notes(1e-3)
    assert "0.001 s, but steps have 0.005 s" in note and "more steps than 40" in note
    assert not notes(0.05)


@restarts_at_every_frame
def test_a_resumed_run_keeps_the_note_on_its_step(tmp_path):
    scene = simulate(SHEET, Implicit(1e-3, frames=4, steps=8), loads=[Fixed(LEFT)], initial_velocity=VELOCITY)
    whole = scene.run(device="cpu")
    scene.run(device="cpu", out=tmp_path, writers=[StopAt(2)])
    resumed = scene.run(device="cpu", out=tmp_path, resume=True)
    (note,) = [note for note in whole.summary["notes"] if note.startswith("step: ")]
    assert note in resumed.summary["notes"]


@pytest.mark.parametrize(
    ("motion", "said"),
    [
        ({"x": [0.0, 0.01, -0.01]}, "Motion: its velocity jumps by 6 m/s at 0.005 s"),
        (
            {"x": 0.0, "angle": [0.0, 0.5, -0.5], "axis": (1, 0, 0), "about": (0.1, 0.025)},
            "jumps by 300 rad/s at 0.005",
        ),
        ({"x": lambda t: 0.005 * (1.0 - np.cos(np.pi * t / 0.01))}, ""),
    ],
)
def test_a_velocity_that_jumps_is_noted_where_the_balance_is_off(motion, said):
    sheet = square(11)
    times = [0.0, 0.005, 0.01] if said else np.linspace(0.0, 0.02, 41)
    loads = [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), times, **{"y": 0.0, "z": 0.0, **motion})]
    result = run(sheet, Implicit(0.02, frames=4, steps=40), material=NeoHookean(mu=3e5, bulk=1e8), loads=loads)
    assert [said in note for note in result.summary["notes"] if "jumps" in note] == ([True] if said else [])


def test_parts_with_forces_of_their_own_are_refused():
    pair = together(square(5), square(5))
    there = placed(pair, Place(), Place((0.0, 0.0, 2e-3)))
    joint = Joint(
        pair.edges("sheet 2"), pair.edges("sheet 1"), energy=8.0, shear_energy=24.0, strength=4e3, shear_strength=6e3,
        stiffness=4e6,
    )  # fmt: skip
    for part in ({"loads": [joint]}, {"contact": SelfContact()}):
        with pytest.raises(InputError, match="not supported by the solver Implicit"):
            run(pair, Implicit(1.0, steps=10), initial_displacement=there, **part)


def test_a_material_remembers_its_largest_energy():
    """A Mullins rubber that is pulled, let go and pulled again, beside steps five times as short."""
    rubber, tube = recipe("mullins").Mullins(MU, 1.5, 0.1 * MU), SHEET.as_cloud()
    left, right = tube.edges("left"), tube.edges("right")
    back = Motion(right, (0.0, 1.0, 2.0), x=(0.0, 0.08, 0.02), y=0.0, z=0.0)
    loads = [Fixed(left), back, Reaction(right, "pull")]
    forces = [
        run(tube, Implicit(2.0, frames=2, steps=steps, inertia=False), material=rubber, loads=loads).history[-1][
            "pull_x"
        ]
        for steps in (10, 50)
    ]
    virgin = run(
        tube, Implicit(2.0, frames=2, steps=10, inertia=False), material=rubber,
        loads=[Fixed(left), Motion(right, (0.0, 2.0), x=(0.0, 0.02), y=0.0, z=0.0), Reaction(right, "pull")],
    ).history[-1]["pull_x"]  # fmt: skip
    assert forces[0] == pytest.approx(forces[1], rel=1e-6)
    assert forces[0] < 0.9 * virgin


def test_viscous_laws_that_implicit_steps_do_not_take():
    rated = Visco(NEO, horizon=2.015, prony=[Prony(c10=MU, time=1.0, exponent=0.5)])
    with pytest.raises(InputError, match="exponent"):
        Simulation(SHEET, rated, Implicit(1.0, steps=10)).run(device="cpu")
    for solver in ({}, {"steps": 3, "tolerance": 1e-3}):
        with pytest.raises(InputError, match="expected one of them"):
            Implicit(1.0, **solver)
