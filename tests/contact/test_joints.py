"""Joints: gradients, momentum, the law of the traction, restart, and sheets that become one."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import build, internal_force, largest_square, refused, rough, square, strain_energy
from resumed_runs import require_same_when_stopped
from small_runs import run, simulate

from warp_pd import (
    Explicit,
    Fixed,
    Joint,
    Motion,
    Newton,
    Place,
    Relaxation,
    Sheet,
    glued,
    placed,
    together,
)

PEEL, SHEAR, STRENGTH, SHEAR_STRENGTH, STIFFNESS = 8.0, 24.0, 4e3, 6e3, 4e6


def two(gap=2e-3, turn=20.0):
    """A square and a smaller one over it, of another grid and turned."""
    lower, upper = square(9), square(6, 0.05)
    sheet = together(lower, upper)
    return sheet, placed(sheet, Place(), Place((0.03, 0.02, gap), degrees=turn))


def glue(sheet, **changes):
    values = {"energy": PEEL, "shear_energy": SHEAR, "strength": STRENGTH, "shear_strength": SHEAR_STRENGTH}
    values |= {"stiffness": STIFFNESS, **changes}
    return Joint(sheet.edges("sheet 2"), sheet.edges("sheet 1"), **values)


def held_apart(direction, way, **changes):
    """Both sheets held; the upper one moves along a direction."""
    sheet, start = two()
    upper = sheet.edges("sheet 2")
    begin = start[upper].tolist()
    # Each point has its own place, so it moves by itself.
    moves = [
        Motion([int(p)], [0.0, 1.0], **{c: [b, b + way * d] for c, b, d in zip("xyz", at, direction, strict=True)})
        for p, at in zip(upper, begin, strict=True)
    ]  # fmt: skip
    loads = [Fixed(sheet.edges("sheet 1")), *moves, glue(sheet, **changes)]
    return {"sheet": sheet, "solver": Explicit(1.0, frames=40), "loads": loads, "initial_displacement": start}


@pytest.mark.parametrize("gap", [0.0, 2e-3])
def test_the_force_is_minus_the_gradient_of_the_energy_and_conserves_momentum(gap):
    sheet, start = two(gap)
    joint, plain = build(sheet, initial_displacement=start, loads=[glue(sheet)]), build(sheet)
    part = next(part for part in joint.parts if part.label == "loads: Joint")
    part.damage.assign(np.random.default_rng(3).uniform(0.0, 0.9, sheet.size))
    here = start + rough(sheet, 0.1)
    force = internal_force(joint, here) - internal_force(plain, here)

    def energy(displacement):
        strain_energy(joint, displacement)
        return part.energy.numpy().sum()

    size = np.abs(force).sum()
    assert size > 0.0 and len(part.points) == 36
    assert np.abs(force.sum(axis=0)).max() < 1e-12 * size
    assert np.abs(np.cross(sheet.positions + here, force).sum(axis=0)).max() < 1e-12 * size
    direction = np.random.default_rng(4).normal(size=here.shape)
    step = 1e-6 * sheet.spacing
    slope = (energy(here + step * direction) - energy(here - step * direction)) / (2.0 * step)
    assert slope == pytest.approx(-(force * direction).sum(), rel=1e-6)


def test_the_bound_of_the_frequency_of_a_joint_holds_and_is_near():
    sheet, start = two()
    joint, far = (build(sheet, initial_displacement=u, loads=[glue(sheet)]) for u in (start, start + 10.0))
    part, moved = (next(p for p in built.parts if p.label == "loads: Joint") for built in (joint, far))
    assert part.added_frequency() == pytest.approx(moved.added_frequency(), rel=1e-9)
    plain = build(sheet)
    square_of = largest_square(
        lambda u: internal_force(joint, u) - internal_force(plain, u), start, joint, sheet.spacing
    )
    assert 0.3 * part.added_frequency() ** 2 < square_of < part.added_frequency() ** 2


@pytest.mark.parametrize(
    ("share", "direction"),
    [(0.0, (0.0, 0.0, 1.0)), (1.0, (0.6, 0.8, 0.0)), (0.36, (0.6, 0.0, 0.8))],
    ids=["peel", "shear", "mixed"],
)
def test_grids_that_do_not_match_open_by_the_law_and_release_its_energy(share, direction):
    """The patch test: traction, damage and released energy are those of Camanho and Davila at every separation."""
    begin = 1.0 / (STIFFNESS * np.sqrt((1.0 - share) / STRENGTH**2 + share / SHEAR_STRENGTH**2))
    energy = 1.0 / ((1.0 - share) / PEEL + share / SHEAR)
    end = 2.0 * energy / (STIFFNESS * begin)
    result = run(**held_apart(direction, 1.25 * end))
    area, history = 0.05**2, result.history
    opened = 1.25 * end * np.array([row["time"] for row in history])
    damage = np.where(opened > begin, end * (opened - begin) / (np.maximum(opened, begin) * (end - begin)), 0.0).clip(
        0, 1
    )
    released = energy * area * ((opened - begin) / (end - begin)).clip(0.0, 1.0)
    stored = 0.5 * (1.0 - damage) * STIFFNESS * area * opened**2
    scale = energy * area
    assert [row["joint_damage"] for row in history] == pytest.approx(damage, abs=1e-9)
    assert [row["joint_released"] for row in history] == pytest.approx(released, abs=1e-9 * scale)
    assert [row["joint"] for row in history] == pytest.approx(stored, abs=1e-9 * scale)
    assert history[-1]["joint_damage"] == 1.0
    # Work of the supports, which know nothing of the joint: the trapezoidal rule misses its kinks.
    assert history[-1]["external"] == pytest.approx(scale, rel=1e-3)
    assert max(abs(row["balance_error"]) for row in history) < 2e-3


@pytest.mark.parametrize("tilt", [20.0, -40.0, 200.0], ids=["tilted", "far", "turned over"])
@pytest.mark.parametrize("sheared", [False, True], ids=["peel", "shear"])
def test_tilted_sheets_peel_along_the_mean_of_their_normals(tilt, sheared):
    """Whichever way a sheet lies: half of the tilt is peel without shear, and across it shear without peel."""
    lower, upper = square(9), square(6, 0.03)
    sheet = together(lower, upper)
    start = placed(sheet, Place(), Place((0.05, 0.035, 0.03), (0.0, 1.0, 0.0), tilt))
    half = np.radians(tilt if abs(tilt) < 90.0 else tilt - 180.0) / 2.0
    mean = np.array([np.sin(half), 0.0, np.cos(half)])
    direction = np.array([np.cos(half), 0.0, -np.sin(half)]) if sheared else mean
    strength, energy = (SHEAR_STRENGTH, SHEAR) if sheared else (STRENGTH, PEEL)
    begin = strength / STIFFNESS
    end, points = 2.0 * energy / strength, sheet.edges("sheet 2")
    moves = [
        Motion([int(p)], [0.0, 1.0], **{c: [at[k], at[k] + 0.5 * (begin + end) * direction[k]]
                                        for k, c in enumerate("xyz")})
        for p, at in zip(points, start[points].tolist(), strict=True)
    ]  # fmt: skip
    loads = [Fixed(sheet.edges("sheet 1")), *moves, glue(sheet, reach=0.1)]
    row = run(sheet, Explicit(1.0, frames=1), loads=loads, initial_displacement=start).history[-1]
    assert row["joint_released"] == pytest.approx(0.5 * energy * 0.03**2, rel=1e-9)
    assert row["joint_damage"] == pytest.approx(end / (begin + end), rel=1e-9)


def test_a_joint_that_is_pressed_does_not_break_and_one_that_closes_does_not_heal():
    pressed = run(**held_apart((0.0, 0.0, -1.0), 5e-3)).history[-1]
    assert pressed["joint_damage"] == pressed["joint_released"] == 0.0
    assert pressed["joint"] == pytest.approx(0.5 * STIFFNESS * 0.05**2 * 5e-3**2)


def test_glue_over_an_area_falls_together_as_one_sheet_and_keeps_its_energy():
    """Two sheets glued face to face, of which one is struck, move on with all momentum and energy."""
    sheet, start = two(0.0)
    velocity = np.zeros((sheet.size, 3))
    velocity[sheet.edges("sheet 2"), 2] = 0.3
    joint = Joint(sheet.edges("sheet 2"), sheet.edges("sheet 1"))
    result = run(sheet, Explicit(0.02, frames=10), loads=[joint], initial_displacement=start, initial_velocity=velocity)
    mass = result.built.to_numpy(result.built.state.mass)[:, None]
    assert (mass * result.frame.velocity).sum(axis=0) == pytest.approx((mass * velocity).sum(axis=0), abs=1e-14)
    assert max(abs(row["balance_error"]) for row in result.history) < 1e-3
    assert "joint_released" not in result.history[0] and "joint_damage" not in result.history[0]
    assert result.history[-1]["joint"] > 0.0


def test_a_breaking_joint_goes_on_bit_for_bit_after_a_stop(tmp_path):
    parts = held_apart((0.6, 0.0, 0.8), 22e-3)
    parts["solver"] = Explicit(0.2, frames=8)
    result = require_same_when_stopped(lambda: simulate(**parts), tmp_path, [5], precision=64)
    assert 0.2 < result.history[5]["joint_damage"] < result.history[-1]["joint_damage"] < 1.0
    assert np.nanmax(result.frame.point_data["joint_damage"]) == pytest.approx(result.history[-1]["joint_damage"])


def test_sheets_glued_along_an_edge_are_one_sheet():
    whole = Sheet.rectangle(0.1, 0.05, thickness=1e-3, density=1000.0, points=13).as_cloud()
    parts = [Sheet.rectangle(w, 0.05, thickness=1e-3, density=1000.0, points=n) for w, n in ((0.05, 7), (0.05, 7))]
    sheet = glued(parts[0], "right", parts[1], "left", Place((0.05, 0.0, 0.0)))
    np.testing.assert_allclose(sheet.points[sheet.edges("sheet 2")], parts[1].points + (0.05, 0.0), atol=1e-12)
    order = np.lexsort(sheet.points.round(9).T)
    np.testing.assert_allclose(sheet.points[order], whole.points, atol=1e-12)
    np.testing.assert_allclose(sheet.areas[order], whole.areas, rtol=1e-12)
    assert len(sheet.edges("seam")) == 7 and set(sheet.edges("seam")) == set(
        sheet.where(lambda x, y: abs(x - 0.05) < 1e-9)
    )
    move = rough(whole, 0.1)
    there = np.empty_like(move)
    there[order] = move
    one, two_ = internal_force(build(whole), move), internal_force(build(sheet), there)[order]
    assert np.abs(one - two_).max() < 1e-9 * np.abs(one).max()


def test_glued_sheets_keep_thickness_mass_and_names():
    thick, thin = (Sheet.tube(0.02, 0.03, thickness=t, density=900.0, points=12) for t in (2e-3, 1e-3))
    tube = glued(thick, "top", thin, "bottom", Place((0.0, 0.0, 0.03)))
    mass = [(sheet.areas * sheet.thickness * sheet.density).sum() for sheet in (tube, thick, thin)]
    assert mass[0] == pytest.approx(mass[1] + mass[2])
    assert tube.thickness[tube.edges("seam")] == pytest.approx(1.5e-3)
    assert tube.positions[tube.edges("sheet 2 top"), 2] == pytest.approx(0.06)
    assert len(tube.edges("rim")) == 24


def test_glued_sheets_of_any_density_and_stiffness_keep_mass_and_tension():
    """The seam weighs, and carries, what its halves do: means over their volumes."""
    heavy = Sheet.rectangle(0.05, 0.05, thickness=3e-3, density=2000.0, points=7)
    light = Sheet.rectangle(0.05, 0.05, thickness=1e-3, density=500.0, points=7)
    soft, stiff = heavy.stiffened(heavy.edges("right"), 0.5), light.stiffened(light.edges("left"), 4.0)
    sheet = glued(soft, "right", stiff, "left", Place((0.05, 0.0, 0.0)))

    def total(each, *factors):
        return (each.areas * each.thickness * np.prod(factors, axis=0)).sum()

    assert total(sheet, sheet.density) == pytest.approx(total(soft, soft.density) + total(stiff, stiff.density))
    assert total(sheet, sheet.stiffness) == pytest.approx(total(soft, soft.stiffness) + total(stiff, stiff.stiffness))
    assert sheet.density[sheet.edges("seam")] == pytest.approx(1625.0)


SQUARE = square(9)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ((SQUARE, "right", SQUARE, "left"), "0.1 m apart: expected points that coincide"),
        ((SQUARE, "right", square(8), "left", Place((0.1, 0, 0))), "edges of 9 and 8 points"),
        ((SQUARE, "right", SQUARE, "left", Place((0.1, 0, 0), (0, 1, 0), -90.0)), "meet at 90 degrees"),
        ((SQUARE, "right", SQUARE, "right"), "same side of the seam"),
        ((SQUARE, [40], SQUARE, [40]), "points along an edge that exactly two sheets share"),
        ((SQUARE.prestretched(1.1), "right", SQUARE, "left"), "first is prestretched"),
        ((SQUARE, "rigth", SQUARE, "left"), "^glued: first: edge = 'rigth'"),
        ((SQUARE, 3, SQUARE, "left"), "^glued: edge of first = 3: expected a name or point indices"),
        ((SQUARE, "right", SQUARE, "left", (0.1, 0, 0)), r"^place = \(0.1, 0, 0\): expected a Place"),
        ((SQUARE, "right", "A", "left"), "^second = 'A': expected a Sheet"),
    ],
)
def test_sheets_that_cannot_become_one_are_refused(arguments, message):
    with refused(match=message):
        glued(*arguments)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"strength": -1.0}, "Joint.strength = -1.0: expected a positive number"),
        (
            {"energy": None, "shear_energy": None, "shear_strength": None},
            "Joint.strength = 4000.0: expected None for glue that holds",
        ),
        ({"energy": "much"}, "Joint.energy = 'much'"),
        ({"energy": -1.0}, "Joint.energy = -1.0: expected a positive number"),
        ({"energy": True}, "Joint.energy = True: expected a positive number"),
        ({"stiffness": 1e5}, "Joint.strength = 4000 Pa: expected less than sqrt"),
        ({"reach": 1e-3}, "none of its 36 points lies on a triangle"),
        ({"stiffness": 1e20}, r"Joint.stiffness = 1e\+20 N/m\^3: expected at most .* shorten the time step"),
    ],
)
def test_wrong_joints_are_refused(changes, message):
    sheet, start = two()
    with refused(match=message):
        build(sheet, initial_displacement=start, loads=[glue(sheet, **changes)])


def test_what_a_joint_cannot_be_combined_with_is_refused():
    sheet, start = two()
    with refused(match="two or more Joint: expected one with the points of all"):
        build(sheet, initial_displacement=start, loads=[glue(sheet), glue(sheet)])
    for solver in (Newton(), Relaxation()):
        with refused(match="not supported by static solvers; expected Explicit"):
            build(sheet, initial_displacement=start, solver=solver, loads=[glue(sheet), Fixed([0])])
    with refused(match="not supported on several processes"):
        glue(sheet).on_partition(sheet, None)
    with refused(match="both contain point 0"):
        build(sheet, loads=[Joint([0, 1], sheet.edges("sheet 1"))])
    with refused(match=r"Joint\.second contains 1 points but all corners of no triangle"):
        build(sheet, loads=[Joint([0], [1])])


def test_a_zone_that_the_spacing_does_not_resolve_is_noted():
    sheet, start = two()
    for strength, number in ((STRENGTH, 1), (PEEL / (6.0 * sheet.spacing), 0)):
        solver = Explicit(1e-3, frames=1)
        joint = glue(sheet, strength=strength, shear_strength=None)
        notes = (
            simulate(sheet, solver, initial_displacement=start, loads=[joint])
            .run(device="cpu", precision=64)
            .summary["notes"]
        )
        assert sum("break at a time in a peel" in note for note in notes) == number


def test_a_stiffness_that_shortens_the_steps_is_noted():
    sheet, start = two()
    weak = {"strength": None, "shear_strength": None}
    usual = build(sheet, initial_displacement=start, loads=[glue(sheet, stiffness=None, **weak)])
    (joint,) = [part for part in usual.parts if part.label == "loads: Joint"]
    for factor, number in ((50.0, 0), (400.0, 1)):
        stiff = glue(sheet, stiffness=factor * joint.stiffness, **weak)
        built = build(sheet, initial_displacement=start, loads=[stiff])
        notes = [note for part in built.parts for note in part.notes([{"mean_damage": 0.0}], None)]
        found = [note for note in notes if "400 times the default, which shortens the time step up to 20 times" in note]
        assert len(found) == number


def test_a_sheet_stands_on_another_one_glued_by_its_edge():
    """A T-joint: the edge bears by the areas of its points, and pulled off it is peeled, not sheared."""
    web, fin = square(9), square(7, 0.06)
    sheet = together(web, fin)
    start = placed(sheet, Place(), Place((0.02, 0.05, 0.0), axis=(1.0, 0.0, 0.0), degrees=90.0))
    foot, upper = sheet.edges("sheet 2")[fin.edges("bottom")], sheet.edges("sheet 2")
    joint = replace(glue(sheet), first=foot)
    built = build(sheet, initial_displacement=start, loads=[joint])
    pulled = start.copy()
    pulled[upper, 2] += 2e-3
    lifted = internal_force(built, pulled)[upper].sum(axis=0)
    assert lifted == pytest.approx([0.0, 0.0, -STIFFNESS * 0.5 * 0.01 * 0.06 * 2e-3], rel=1e-6, abs=1e-9)
    moves = [
        Motion([int(p)], [0.0, 1.0], x=float(start[p, 0]), y=float(start[p, 1]), z=[z, z + 5e-3])
        for p, z in zip(upper, start[upper, 2].tolist(), strict=True)
    ]
    loads = [Fixed(sheet.edges("sheet 1")), *moves, joint]
    result = run(sheet, Explicit(1.0, frames=2), initial_displacement=start, loads=loads)
    assert result.history[-1]["joint_released"] == pytest.approx(PEEL * 0.5 * 0.01 * 0.06, rel=1e-9)


@pytest.mark.parametrize(("name", "energy"), [("strength", PEEL), ("shear_strength", SHEAR)])
def test_glue_opens_elastically_before_its_energy_is_spent(name, energy):
    """It has strength^2 / (2 stiffness) when it reaches its strength: less than its energy, or it is refused."""
    sheet, start = two()
    for share in (0.99, 1.01):
        changes = {
            "strength": 1e2,
            "shear_strength": 1e2,
            name: STRENGTH,
            "stiffness": STRENGTH**2 / (2.0 * energy) * share,
        }
        scene = {"initial_displacement": start, "loads": [glue(sheet, **changes)]}
        if share > 1.0:
            build(sheet, **scene)
            continue
        with refused(match=rf"Joint.{name} = 4000 Pa: expected less than sqrt"):
            build(sheet, **scene)


def test_joint_damage_is_the_mean_over_the_joined_area():
    strong = np.where(np.isin(np.arange(81 + 36), 81 + square(6, 0.05).edges("all")), 4.0 * PEEL, PEEL)
    scene = held_apart((0.0, 0.0, 1.0), 3e-3, energy=strong, shear_energy=4.0 * PEEL)
    result = run(**scene, fields=())
    damage = result.frame.point_data["joint_damage"]
    joined = np.isfinite(damage)
    areas = scene["sheet"].areas[joined]
    mean = (damage[joined] * areas).sum() / areas.sum()
    assert 0.1 < mean < 0.9 and abs(mean - damage[joined].mean()) > 0.03
    assert result.history[-1]["joint_damage"] == pytest.approx(mean, rel=1e-6)
