"""Sheets that were stretched before they were clamped: what stays, what is without stress, and wrong input."""

import numpy as np
import pytest
from enclosed_cases import ball
from helpers import build, internal_force, jittered, refused, square, strain_energy
from small_runs import run, simulate

from warp_pd import (
    Explicit,
    Fixed,
    Measure,
    MooneyRivlin,
    Motion,
    Newton,
    Prony,
    Relaxation,
    Sheet,
    Simulation,
    Visco,
)
from warp_pd.geometry.sheet import Shape
from warp_pd.measures import support_force

RUBBER = MooneyRivlin(500.0)
SHAPES = {"lattice": square, "cloud": jittered}


def density(a, b):
    """Energy density of RUBBER at two stretches [J/m^3]."""
    return 500.0 * (a**2 + b**2 + (a * b) ** -2 - 3.0)


def test_points_and_selections_are_those_of_the_clamped_sheet():
    before = square(9)
    edge, inner = before.edges("left"), before.within((0.05, 0.05), 0.02)
    sheet = before.prestretched(1.5, 1.2)
    assert (sheet.points == before.points).all() and (sheet.areas == before.areas).all()
    assert sheet.spacing == before.spacing and sheet.lattice == before.lattice
    assert (sheet.edges("left") == edge).all() and (sheet.within((0.05, 0.05), 0.02) == inner).all()
    # Points that were chosen before belong to this sheet.
    build(sheet, loads=[Fixed(edge), Fixed(sheet.edges("right"))], material=RUBBER)


def test_the_state_without_stress_is_smaller():
    sheet = square(9).prestretched(1.5, 1.2)
    free = sheet.unstretched()
    assert np.ptp(free.points, axis=0) == pytest.approx([0.1 / 1.5, 0.1 / 1.2])
    assert free.points.mean(axis=0) == pytest.approx([0.05, 0.05])
    assert free.areas.sum() == pytest.approx(0.01 / 1.8)
    assert (free.lattice.dx, free.lattice.dy) == pytest.approx((0.0125 / 1.5, 0.0125 / 1.2))
    assert free.stretch is None and free.unstretched() is free
    twice = square(9).prestretched(1.2).prestretched(1.25, 1.0).unstretched()
    assert twice.points == pytest.approx(free.points)


@pytest.mark.parametrize("edit", [
    lambda sheet: sheet.cut((0.02, 0.033), (0.06, 0.071)), lambda sheet: sheet.hole((0.05, 0.05), 0.02),
    lambda sheet: sheet.as_cloud(), lambda sheet: sheet.stiffened([0, 5], 2.0),
])  # fmt: skip
def test_edits_before_and_after_are_the_same(edit):
    one, other = (
        sheet.unstretched() for sheet in (edit(square(13)).prestretched(1.3), edit(square(13).prestretched(1.3)))
    )
    assert one.points == pytest.approx(other.points, abs=1e-15) and one.areas == pytest.approx(other.areas)
    assert (one.triangles == other.triangles).all() and np.array(one.cuts) == pytest.approx(np.array(other.cuts))
    bonds = [build(sheet).law.families.bond_count for sheet in (one, edit(square(13)))]
    assert bonds[0] == bonds[1]


def test_a_stretch_turns_with_the_sheet():
    one = square(9).prestretched(1.5, 1.2).turned(30.0).unstretched()
    other = square(9).prestretched(1.5, 1.2).unstretched().turned(30.0)
    assert one.points == pytest.approx(other.points, abs=1e-15)


@pytest.mark.parametrize("shape", SHAPES)
@pytest.mark.parametrize(("bits", "bound"), [(64, 1e-12), (32, 2e-5)])
def test_it_begins_with_the_energy_and_the_pull_of_the_stretch(shape, bits, bound):
    a, b = 1.4, 1.2
    sheet = SHAPES[shape](13).prestretched(a, b)
    built = build(
        sheet, material=RUBBER, loads=[Fixed(sheet.edges("all"))], precision=bits, weights="corrected", horizon=2.015
    )
    start = built.to_numpy(built.state.displacement)
    volume = 0.01 / (a * b) * 1e-3
    assert built.volume.sum() == pytest.approx(volume)
    assert built.to_numpy(built.state.mass).sum() == pytest.approx(1000.0 * volume, rel=1e-6)
    assert strain_energy(built, start) == pytest.approx(density(a, b) * volume, rel=max(bound, 1e-6))
    force = internal_force(built, start)
    inner = np.setdiff1d(np.arange(sheet.size), sheet.edges("all"))
    pull = 1000.0 * (a - 1.0 / (a**3 * b**2)) * 1e-3 * 0.1 / b
    assert np.abs(force[inner]).max() < bound * pull
    # Corners carry pulls of both edges, each along its own axis.
    assert support_force(built, sheet.edges("right"))[0] == pytest.approx(pull, rel=max(bound, 1e-6))
    assert np.abs(internal_force(built, np.zeros((sheet.size, 3)))).max() < 1e-12 * pull


@pytest.mark.parametrize(
    ("shape", "solver"),
    [("lattice", Relaxation(tolerance=1e-8, ramp_steps=200)), ("lattice", Newton()), ("cloud", Newton())],
)
def test_it_is_a_sheet_stretched_by_its_supports(shape, solver):
    """Moved on from there, or pulled there and on from the state without stress: one equilibrium."""
    sheet = SHAPES[shape](13).prestretched(1.3)
    free = sheet.unstretched()
    right, edge = sheet.edges("right"), sheet.edges("all")
    parts = {"material": RUBBER, "weights": "corrected", "horizon": 2.015}
    loads = [Fixed(np.setdiff1d(edge, right)), Motion(right, [0.0, 1.0], x=[0.0, 0.01], y=0.0, z=0.0)]
    one = run(sheet, solver, loads=loads, **parts)
    u = sheet.points - free.points
    moves = [
        Motion(
            [point], [0.0, 1.0], x=[u[point, 0], u[point, 0] + (0.01 if point in right else 0.0)], y=u[point, 1], z=0.0
        )
        for point in edge
    ]
    start = np.column_stack([u, np.zeros(sheet.size)])
    other = run(free, solver, loads=moves, initial_displacement=start, **parts)
    assert one.status == other.status == "finished"
    assert one.frame.displacement == pytest.approx(other.frame.displacement - start, abs=1e-8)
    assert one.frame.displacement[right, 0] == pytest.approx(0.01, abs=1e-12)


def test_frames_and_motions_begin_at_the_clamped_sheet():
    sheet = square(13).prestretched(1.3)
    right = sheet.edges("right")
    rest = np.setdiff1d(sheet.edges("all"), right)
    loads = [Fixed(rest), Motion(right, [0.0, 0.01], x=[0.0, 2e-3], y=0.0, z=[0.0, 1e-3])]
    result = run(sheet, Explicit(0.01, frames=2), loads=loads, material=RUBBER, precision=64, weights="corrected")
    assert result.frame.displacement[right] == pytest.approx(np.tile([2e-3, 0.0, 1e-3], (len(right), 1)), abs=1e-8)
    assert result.frame.displacement[rest] == pytest.approx(0.0, abs=1e-15)
    assert abs(result.history[-1]["balance_error"]) < 1e-2


def test_written_positions_are_those_of_the_clamped_sheet(tmp_path):
    import h5py

    sheet = square(9).prestretched(1.3)
    simulate(sheet, Newton(), loads=[Fixed(sheet.edges("all"))], material=RUBBER, weights="corrected").run(
        device="cpu", out=tmp_path, usd=False
    )
    with h5py.File(tmp_path / "frames.vtkhdf") as file:
        assert file["VTKHDF/Points"][: sheet.size] == pytest.approx(sheet.positions, abs=1e-7)
        assert np.abs(file["VTKHDF/PointData/displacement"][()]).max() < 1e-12


WRONG = [
    (lambda: square(5).prestretched(0.0), r"first = 0\.0"),
    (lambda: square(5).prestretched(1.2, -1.0), r"second = -1\.0"),
    (lambda: square(9).inclusion((0.05, 0.05), 0.03).prestretched(1.2), "rigid inclusions"),
    (lambda: Sheet.line(1.0, 1e-4, density=1e3, points=9).prestretched(1.2), "a bar"),
]


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_stretches_are_named(make, text):
    with refused(match=text):
        make()


def test_a_curved_sheet_shrinks_alike_in_all_directions():
    points, triangles = ball(1)
    shape = Shape(points=points, areas=np.ones(len(points)), triangles=triangles.astype(np.int32), spacing=0.3)
    sheet = Sheet.of(shape, thickness=1e-3, density=1e3).prestretched(1.6)
    assert sheet.unstretched().positions == pytest.approx(points / 1.6)
    assert sheet.placement() == pytest.approx(points * 0.6 / 1.6)
    assert sheet.unstretched().areas == pytest.approx(1.0 / 1.6**2)
    with refused(match="one stretch in all directions for a curved sheet"):
        sheet.prestretched(1.0, 1.1)


def test_a_viscous_sheet_begins_unrelaxed():
    """The whole stress at first, later the share of it that stays."""
    sheet = square(9).prestretched(1.2)
    law = Visco(RUBBER, horizon=2.015, weights="corrected", prony=(Prony(300.0, 0.0, 0.01),))
    pull = Measure("pull", "N", lambda built, frame: support_force(built, sheet.edges("right"))[0])
    result = Simulation(
        sheet, law, Explicit(0.1, frames=2, damping=100.0), loads=[Fixed(sheet.edges("all"))], measures=[pull]
    ).run(device="cpu", precision=64)
    relaxed = 1000.0 * (1.2 - 1.2**-5) * 1e-3 * 0.1 / 1.2
    first, last = result.history[0]["pull"], result.history[-1]["pull"]
    assert first == pytest.approx(relaxed * (1.0 + 300.0 / 500.0), rel=1e-3)
    assert last == pytest.approx(relaxed, rel=1e-3)
