"""What a run says before its first step, and while it runs."""

import io

import numpy as np
import pytest
from helpers import NEO, square
from small_runs import simulate

import warp_pd
from warp_pd import (
    ArrudaBoyce,
    Bimodular,
    BodyForce,
    BodyPath,
    BondAssociated,
    BondBased,
    BondNeoHookean,
    Box,
    ByRegion,
    Carroll,
    CriticalEnergy,
    CriticalEnergyDensity,
    CriticalStress,
    CriticalStretch,
    CutsInTime,
    EnclosedGas,
    EnclosedVolume,
    Explicit,
    ExtendedTube,
    Fixed,
    Free,
    Gent,
    HyperelasticBonds,
    Maxwell,
    MooneyRivlin,
    Motion,
    NeoHookean,
    Newton,
    Ogden,
    PointForce,
    Pressure,
    Prony,
    Punch,
    RigidBall,
    RigidBody,
    Simulation,
    Sphere,
    TearingEnergy,
    TensionField,
    Visco,
    Yeoh,
)
from warp_pd.interfaces import Rupture
from warp_pd.materials import PlaneStress
from warp_pd.output.progress import Progress, duration_text
from warp_pd.run.checks import count_text, foreseen, step_note

# Classes to inherit from.
BASES = {"BondCriterion", "FamilyCriterion", "Incompressible", "PlaneStress", "Rupture"}


def notes(sheet=None, solver=None, **parts):
    sheet = sheet or square(7)
    return foreseen(simulate(sheet, solver or Newton(), **parts).build("cpu"))


def test_a_run_notes_an_unstable_material_in_its_summary():
    sheet = square(5)
    scene = simulate(sheet, Newton(), material=Yeoh(1e5, -5e4, 1e3), loads=[Fixed(sheet.edges())])
    assert "Yeoh: the material is unstable beyond" in scene.run(device="cpu").summary["notes"][0]


def test_usual_scenes_have_nothing_to_say():
    sheet = square(7)
    for solver in (Newton(), Explicit(0.01)):
        for material in (NEO, MooneyRivlin(2e5, 1e4), NeoHookean(4e5, 4e7)):
            assert notes(sheet, solver, material=material, loads=[Fixed(sheet.edges()), Pressure(5.0)]) == []


def test_what_a_run_never_reaches_is_noted():
    sheet = square(7)
    right = sheet.edges("right")
    pull = Motion(right, [0.0, 10.0], x=[0.0, 0.02])
    (note,) = notes(sheet, loads=[Fixed(sheet.edges("left")), pull])
    assert note == (
        "Motion: it changes until 10 s, and Newton ends at the load time 1 s: expected times up to that, or "
        "Newton(duration=10)"
    )
    assert notes(sheet, Newton(duration=10.0), loads=[Fixed(sheet.edges("left")), pull]) == []
    # What no longer changes is reached.
    held = Motion(right, [0.0, 1.0, 10.0], x=[0.0, 0.02, 0.02])
    assert notes(sheet, loads=[Fixed(sheet.edges("left")), held]) == []
    turn = Motion(right, [0.0, 2.0], angle=[0.0, 1.0])
    ramp = Pressure(5.0, ramp=[(0.0, 0.0), (3.0, 1.0)])
    ball = RigidBody(Sphere(0.03), BodyPath([0.0, 4.0], [(0.05, 0.05, 0.1), (0.05, 0.05, 0.05)]))
    volume = EnclosedVolume([(0.0, 0.0), (5.0, 1e-6)], stiffness=1e6)
    for parts, said in (
        ({"loads": [Fixed(sheet.edges("left")), turn]}, "Motion: it changes until 2 s"),
        ({"loads": [Fixed(sheet.edges()), ramp]}, "Pressure ramp: it changes until 3 s"),
        ({"loads": [Fixed(sheet.edges())], "contact": ball}, "BodyPath: it changes until 4 s"),
        ({"loads": [Fixed(sheet.edges()), volume]}, "EnclosedVolume.volume ramp: it changes until 5 s"),
    ):
        assert [note for note in notes(sheet, Explicit(0.01), **parts) if note.startswith(said)], said
        assert "and the run ends at 0.01 s" in notes(sheet, Explicit(0.01), **parts)[0]


@pytest.mark.parametrize(("changes", "parts", "said"), [
    ({"size": 100.0}, {}, "the sheet is 100 m wide; are its points in mm"),
    ({"thickness": 1.0}, {}, "1 m thick and 0.1 m wide; is the thickness in mm"),
    ({"density": 1.1e6}, {}, "the density is 1.1e+06 kg/m^3, more than of any metal"),
    ({"density": 1.1}, {}, r"the density is 1.1 kg/m^3; is it in g/cm^3"),
    ({}, {"material": NeoHookean(0.4, 40.0)}, "the shear modulus is 0.4 Pa; are the constants in MPa"),
    ({}, {"material": MooneyRivlin(0.2, 0.02)}, "the shear modulus is 0.44 Pa; are the constants in MPa"),
    ({}, {"pressure": 5e5}, "Pressure(500000) is 5e+04 times what the sheet carries"),
])  # fmt: skip
def test_sizes_that_cannot_be_meant_are_one_note(changes, parts, said):
    sheet = square(7, **changes)
    loads = [Fixed(sheet.edges()), Pressure(parts.pop("pressure", 1.0))]
    (note,) = notes(sheet, Explicit(1e-3), loads=loads, **parts)
    assert note.startswith("sizes: ") and said in note


# Constants that are swapped or in another unit, and those that are meant; the sheet has a width of 0.1 m.
RUBBER, HALF = Yeoh(2e5, 2e3, 1e2), range(45)
CONSTANTS = [
    (NeoHookean(2e8, 2e5), NeoHookean(2e5, 2e8), "NeoHookean.mu = 2e+08 is more than bulk; are its constants in the"),
    (Gent(2e5, 30.0, 2e9), Gent(2e5, 2e9, 30.0), "Gent.lock = 2e+09 is more than 10000"),
    (TensionField(Gent(2e5, 30.0, 50.0)), TensionField(Gent(2e5, 2e7, 50.0)), "Gent.mu = 200000 is more than bulk"),
    (ByRegion(RUBBER, [(HALF, NeoHookean(2e8, 2e5))]), ByRegion(RUBBER, [(HALF, NeoHookean(2e5, 2e8))]), "NeoHookean"),
    (MooneyRivlin(30.0, 2e5), MooneyRivlin(2e5, 2e4), "MooneyRivlin.c01 = 200000 is more than ten times c10"),
    (Yeoh(91.0, 0.0, 2e5), RUBBER, "Yeoh.c30 = 200000 is more than ten times c10"),
    (ArrudaBoyce(20.0, 2e5), ArrudaBoyce(2e5, 5.0), "ArrudaBoyce.lock = 200000 is more than 100"),
    (Carroll(0.2, 2e5, 1e2), Carroll(2e5, 0.2, 1e2), "Carroll.b = 200000 is more than a hundredth of the others"),
    (Ogden((1.3, 5.0), (6e5, 1e3)), Ogden((6e5, 1e3), (1.3, 5.0)), "Ogden.exponents = 600000 is more than 100"),
    (ExtendedTube(0.2, 0.1, 0.2, 0.2), ExtendedTube(2e5, 0.1, 2e5, 0.2), "the shear modulus is 0.396 Pa"),
    (Maxwell(0.8, 2e5), Maxwell(2e5, 0.8), "Maxwell(modulus=0.8, time=200000): its modulus is 2e-06 times the shear"),
    (Prony(0.8, time=2e5), Prony(2e5, time=0.8), "Prony(c10=0.8, time=200000): its modulus is 4e-06 times the shear"),
    (CriticalStress(2.0), CriticalStress(2e6), "CriticalStress.principal of 2 Pa is 5e-06 times the shear modulus"),
    (CriticalStress(2e11), CriticalStress(3e5), "CriticalStress.principal of 2e+11 Pa is 5e+05 times the shear"),
    (CriticalEnergyDensity(2.0), CriticalEnergyDensity(2e6), "CriticalEnergyDensity.density of 2 J/m^3 is 5e-06 times"),
    (CriticalEnergy(5e6), CriticalEnergy(5e2), "CriticalEnergy.energy of 5e+06 J/m^2 over the shear modulus is 12.5 m"),
    (TearingEnergy(5e6), TearingEnergy(5e3), "TearingEnergy.energy of 5e+06 J/m^2 over the shear modulus is 12.5 m"),
    (TearingEnergy(0.1), TearingEnergy(50.0), "TearingEnergy.energy of 0.1 J/m^2 over the shear modulus is 2.5e-07 m"),
    (TearingEnergy(5e3, 0.05, 2.0), TearingEnergy(5e3, 0.05, 1e4), "TearingEnergy.strength of 2 J/m^3 is 5e-06 times"),
    (CutsInTime([Punch((0.05, 0.05), 0.02, 0.5)], TearingEnergy(5e6)), TearingEnergy(5e3), "TearingEnergy.energy of"),
    (CriticalStretch(500.0), CriticalStretch(5.0), "CriticalStretch.stretch is 500; is it in percent"),
    (Bimodular(0.5), Bimodular(5e5), "the shear modulus is 0.167 Pa; are the constants in MPa"),
    (BondNeoHookean(0.2), BondNeoHookean(2e5), "the shear modulus is 0.2 Pa; are the constants in MPa"),
]  # fmt: skip


def parts_with(given):
    """Arguments of a scene with a material, a viscous element or a criterion."""
    if isinstance(given, Maxwell | Prony):
        terms = {"branches" if isinstance(given, Maxwell) else "prony": (given,)}
        return {"force": Visco(RUBBER, weights="plain", **terms)}
    if isinstance(given, Bimodular):
        return {"force": BondBased(given)}
    if isinstance(given, BondNeoHookean):
        return {"force": HyperelasticBonds(given)}
    if isinstance(given, Rupture):
        return {"force": Visco(RUBBER, weights="plain"), "damage": given}
    return {"force": BondAssociated(given, weights="plain")}


@pytest.mark.parametrize(("wrong", "right", "said"), CONSTANTS)
def test_constants_that_cannot_be_meant_are_noted(wrong, right, said):
    def sizes(given):
        sheet = square(9).as_cloud() if isinstance(given, ByRegion) else square(9)
        built = Simulation(sheet, solver=Explicit(1e-4), loads=[Fixed(sheet.edges())], **parts_with(given)).build("cpu")
        return [note for note in foreseen(built) if note.startswith("sizes: ")]

    (note,) = sizes(wrong)
    assert said in note and len(note.splitlines()) == 1
    assert sizes(right) == []


def test_every_material_criterion_and_viscous_element_is_asked():
    asked = {type(part).__name__ for part, _, _ in CONSTANTS}
    every = [getattr(warp_pd, name) for name in warp_pd.__all__]
    made = {kind.__name__ for kind in every if isinstance(kind, type) and {PlaneStress, Rupture} & set(kind.__mro__)}
    assert made - BASES <= asked
    assert {"Maxwell", "Prony", "TensionField", "ByRegion", "Bimodular", "BondNeoHookean"} <= asked


# Scenes on a square of 0.1 m, which carries 0.4 N at a stretch of two, and whose shear waves move at 1 m/s.
STILL = BodyPath.still((0.05, 0.05, 0.1))


@pytest.mark.parametrize(("part", "said"), [
    (BodyForce((0.0, 0.0, -1e9)), "BodyForce of 1e+09 N/m^3 is 1e+05 times what the sheet carries"),
    (PointForce([24], (0.0, 0.0, 500.0), ramp=[(0.0, 0.0), (1e-3, 2.0)]), "PointForce of 1e+03 N is 1e+04 times"),
    (EnclosedGas(gauge=5e5, chamber=1e-3), "EnclosedGas.gauge of 500000 Pa is 5e+04 times what the sheet carries"),
    (EnclosedGas(ambient=1.013, chamber=1e-3), "EnclosedGas.ambient is 1.013 Pa; is it in bar or kPa"),
    (EnclosedGas(chamber=2.0), "EnclosedGas.chamber is 2 m^3, a ball with an area of 768 times the sheet's; is it in"),
    (EnclosedVolume([(0.0, 0.0), (1e-3, 1.0)], 1e6), "EnclosedVolume.volume reaches 1 m^3, a ball with an area of 484"),
    (Motion([24], [0.0, 1e-3], z=[0.0, 5.0]), "Motion moves its points by 5 m, 50 times the width of the sheet; is it"),
    (Motion([24], [0.0, 1e-3], z=[0.0, 0.05]), "Motion moves its points at 50 m/s, 50 times the speed of its shear"),
    (Motion([24, 25], [0.0, 1e-3], angle=[0.0, 90.0]), "90 rad; is it in degrees? They are 1.571 rad"),
    (RigidBall(5.0, (0.05, 0.05, 2.6)), "RigidBall has a size of 5 m, 50 times the width of the sheet"),
    (RigidBall(0.05, (0.05, 0.05, 150.0)), "RigidBall starts at a distance of 150 m, 1.5e+03 times"),
    (RigidBall(0.05, (0.05, 0.05, 0.05), (0.0, 0.0, -50.0)), "RigidBall moves at 50 m/s, 50 times the speed of its"),
    (RigidBody(Box((5.0, 5.0, 0.1)), STILL), "RigidBody 'body' has a size of 7.07 m"),
    (RigidBody(Sphere(0.05), Free(500.0, (0.05, 0.05, 0.05))), "'body': its weight of 4.9e+03 N is 4.9e+04 times"),
])  # fmt: skip
def test_sizes_of_parts_that_cannot_be_meant_are_noted(part, said):
    sheet = square(7)
    given = {"contact": part} if isinstance(part, RigidBall | RigidBody) else {}
    loads = [] if given or isinstance(part, Motion) else [Fixed(sheet.edges())]
    (note,) = notes(sheet, Explicit(1e-3), loads=[*loads, *([] if given else [part])], **given)
    assert note.startswith("sizes: ") and said in note and len(note.splitlines()) == 1


def test_an_initial_state_that_cannot_be_meant_is_noted():
    sheet = square(7)
    far = np.tile((0.0, 0.0, 20.0), (sheet.size, 1))
    (note,) = notes(sheet, Explicit(1e-3), initial_displacement=far, initial_velocity=5.0 * far)
    assert "initial_displacement reaches 20 m, 200 times the width" in note
    assert "initial_velocity reaches 100 m/s, 100 times the speed of its shear waves" in note


def test_a_direction_that_nothing_holds_is_noted_in_static_equilibrium():
    sheet = square(7)
    (note,) = notes(sheet, loads=[Pressure(5.0)])
    assert note.startswith("supports: none holds the sheet along x and y and z: expected Fixed or Motion")
    sides = [Fixed(sheet.edges("left"), "x"), Fixed(sheet.edges("bottom"), "y")]
    (note,) = notes(sheet, loads=[*sides, Pressure(5.0)])
    assert "along z:" in note
    assert notes(sheet, loads=[*sides, Fixed(sheet.edges(), "z")]) == [] == notes(sheet, Explicit(0.1), loads=[])


def test_a_body_force_of_the_size_of_g_is_noted():
    sheet = square(7)
    (note,) = notes(sheet, loads=[Fixed(sheet.edges()), BodyForce((0.0, 0.0, -9.81))])
    weight = float(np.mean(sheet.density)) * 9.81
    assert "BodyForce is 9.81 N/m^3; is it an acceleration?" in note and f"{weight:.4g} N/m^3" in note
    assert notes(sheet, loads=[Fixed(sheet.edges()), BodyForce((0.0, 0.0, -weight))]) == []


def test_a_point_force_on_supports_is_noted():
    """One point or one component that is free is enough to say nothing."""
    sheet = square(7)
    fixed, left = Fixed(sheet.edges(), "xz"), sheet.edges("left")
    middle = Fixed([24], "y")
    (note,) = notes(sheet, loads=[fixed, middle, PointForce(left, (0.0, 0.0, 1.0))])
    assert note == "PointForce (0.0, 0.0, 1.0) N: supports hold all of its points, and it moves nothing"
    for points, force in ((left, (0.0, 1.0, 1.0)), (np.append(left, sheet.nearest(0.05, 0.05)), (0.0, 0.0, 1.0))):
        assert notes(sheet, loads=[fixed, middle, PointForce(points, force)]) == []


def test_a_tiny_step_is_noted_with_its_cause():
    sheet = square(7)

    def said(material=NEO, **solver):
        scene = simulate(sheet, Explicit(1e-3, **solver), material=material, loads=[Fixed(sheet.edges())])
        built = scene.build("cpu")
        return step_note(built, built.solver.first_step(Silent()))

    assert said() == ""
    assert said(safety=1e-7).endswith("safety = 1e-07 was given")
    assert said(damping=1e9).endswith("in which damping takes a fifth of the velocity (damping = 1e+09)")
    assert said(step=1e-9).endswith("step = 1e-09 was given")


class Silent:
    """A sink of frames that keeps what the solver says."""

    stable_dt = None


def test_progress_tells_the_steps_and_the_time_left(monkeypatch):
    """Within a frame of many steps, after a hundred of them."""
    from warp_pd.output import progress
    from warp_pd.run import recorder

    monkeypatch.setattr(recorder, "SECONDS_SHOWN", 0.0)
    monkeypatch.setattr(progress, "LONG", 0.0)
    shown = io.StringIO()
    monkeypatch.setattr("sys.stderr", shown)
    sheet = square(7)
    scene = Simulation(sheet, simulate(sheet).force, Explicit(1e-2, frames=1, safety=1e-5), [Fixed(sheet.edges())])
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(recorder.Recorder, "keep_going", stop_later())
        result = scene.run(device="cpu", reporter=Progress())
    lines = shown.getvalue().splitlines()
    assert result.status == "interrupted"
    assert any(line.startswith("step ") and "steps for 0.01 s" in line for line in lines)
    assert any("steps/s, " in line and line.endswith(" left") for line in lines)


@pytest.mark.parametrize(("paces", "said"), [
    ([1.0] * 20, ["about 18 s"]),
    ([1.0] * 4 + [1.6] + [1.0] * 15, ["about 18 s"]),
    ([1.0] * 4 + [8.0] * 16, ["about 18 s", "about 2 min at the pace of the last frames"]),
])  # fmt: skip
def test_the_time_left_is_told_again_where_frames_have_become_slow(paces, said, monkeypatch):
    """As where frames are computed again with half the step: the attempts that failed do not count."""
    from types import SimpleNamespace

    from warp_pd.run import recorder

    clock, lines = [0.0], []
    monkeypatch.setattr(recorder, "perf_counter", lambda: clock[0])
    solver = Explicit(20.0, frames=20)
    built = SimpleNamespace(simulation=SimpleNamespace(solver=solver), context=SimpleNamespace(device="cpu"))
    left = recorder.TimeLeft(built, SimpleNamespace(say=lines.append))
    for frame, pace in enumerate(paces):
        left.begin_frame()
        if pace > 2.0 and frame == 4:
            clock[0] += 3.0
            left.begin_frame(again=True)
        clock[0] += pace
        left.end_frame(frame, frame + 1.0)
        left.foretell(frame + 1.0)
    assert [line.replace(" to go on this machine", "") for line in lines] == said


def stop_later():
    """A `keep_going` that ends the run at its third call."""
    calls = []

    def keep_going(self):
        calls.append(1)
        if len(calls) > 2:
            raise KeyboardInterrupt

    return keep_going


def test_durations_and_counts_are_for_people():
    assert [duration_text(s) for s in (5.0, 600.0, 66600.0, 8.64e5, 1e9)] == [
        "5 s", "10 min", "18.5 h", "10 days", "31.7 years",
    ]  # fmt: skip
    assert [count_text(n) for n in (999.6, 12000.0, 4.9e7)] == ["1 000", "12 000", "4.9e+07"]
    assert np.isfinite(float(count_text(4.9e7)))
