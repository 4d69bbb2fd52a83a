"""Damage at the start around cuts: its energy is that of their length, and a tear of bridges takes theirs."""

import re

import numpy as np
import pytest
from helpers import NEO, build, square

from warp_pd import BondAssociated, Explicit, Sheet, Simulation, TearingEnergy, TensionField
from warp_pd.tearing.cut_profiles import CAP, CutEnds

GC = 10.0


def perforated(points, slit=0.02, bridge=0.02, as_cloud=False):
    """A square of 0.1 m with a line of slits across, off the rows of points."""
    spacing = 0.1 / (points - 1)
    begins = 0.5 * bridge + (slit + bridge) * np.arange(int(0.1 / (slit + bridge)))
    paths = [((x, 0.05 + 0.5 * spacing), (x + slit, 0.05 + 0.5 * spacing)) for x in begins]
    if as_cloud:
        corners = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
        return Sheet.outline(corners, spacing=spacing, cracks=[list(p) for p in paths], thickness=1e-3, density=1e3)
    sheet = square(points)
    for path in paths:
        sheet = sheet.cut(*path)
    return sheet


def cut_length(built, as_cloud):
    """Length of the crack whose energy the field starts with, from that of a cut across a sheet."""
    spacing, length = built.context.whole.spacing, built.rupture.length
    if as_cloud:
        corners = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]
        across = [[(0.0, 0.05), (0.1, 0.05)]]
        sheet = Sheet.outline(corners, spacing=spacing, cracks=across, thickness=1e-3, density=1e3)
    else:
        sheet = square(round(0.1 / spacing) + 1).cut((-0.01, 0.05 + 0.5 * spacing), (0.11, 0.05 + 0.5 * spacing))
    whole = build(sheet, damage=TearingEnergy(GC, length=length)).rupture
    return 0.1 * built.rupture._fracture_at_start / whole._fracture_at_start


@pytest.mark.parametrize(
    ("points", "slit", "bridge", "as_cloud"),
    [(81, 0.03, 0.02, False), (61, 0.03, 0.02, False), (81, 0.015, 0.01, False), (81, 0.03, 0.02, True),
     (81, 0.015, 0.01, True)],
)  # fmt: skip
def test_slits_start_with_the_energy_of_their_length(points, slit, bridge, as_cloud):
    """So that a tear through all bridges takes the tearing energy of what is not cut."""
    sheet = perforated(points, slit, bridge, as_cloud)
    built = build(sheet, damage=TearingEnergy(GC))
    cut = slit * int(0.1 / (slit + bridge))
    assert cut_length(built, as_cloud) == pytest.approx(cut, rel=0.06)
    assert not built.rupture._cuts.notes(
        built.rupture.length, 1.0, sheet.spacing, built.rupture._at_start, sheet.points
    )


def test_the_default_length_leaves_room_for_bridges_and_a_note_says_where_it_cannot():
    wide, narrow = (TearingEnergy(GC), square(41).cut((0.03, 0.0512), (0.07, 0.0512))), perforated(31, 0.01, 0.01)
    assert build(wide[1], damage=wide[0]).rupture.length == pytest.approx(4.0 * wide[1].spacing)
    built = build(narrow, damage=TearingEnergy(GC))
    assert built.rupture.length == pytest.approx(1.25 * built.law.families.horizon)
    start = narrow.spacing, built.rupture._at_start, narrow.points
    (said,) = built.rupture._cuts.notes(built.rupture.length, built.rupture.constants.bias, *start)
    assert "two cuts are 0.01 m apart, 1.2 lengths of the damage field" in said
    place = [float(x) for x in re.search(r"the bridge at \((\S+), (\S+)\) m starts", said).groups()]
    # Halfway between two slits, or on the edge halfway to the mirror image of one.
    assert place[0] % 0.02 == pytest.approx(0.0, abs=1e-4) or place[0] % 0.02 == pytest.approx(0.02, abs=1e-4)
    assert place[1] == pytest.approx(0.05 + 0.5 * narrow.spacing, abs=1e-4)
    assert "the tear between them takes some 60% of the tearing energy" in said
    assert "which needs a spacing of 0.00062 m" in said
    finer = build(perforated(81, 0.02, 0.02), damage=TearingEnergy(GC)).rupture
    assert finer._at_start[np.argmin(np.linalg.norm(finer.context.sheet.points - [0.04, 0.05], axis=1))] < 0.2


@pytest.mark.parametrize(("points", "length", "said"), [(41, 0.0075, None), (41, 0.012, False), (81, 0.012, True)])
def test_a_note_names_the_edge_that_a_cut_faces_and_asks_for_no_length_in_use(points, length, said):
    """The ligament is 0.015 m long, half of the way to the mirror image, and has room for a length of 0.0075 m."""
    sheet = square(points).cut((0.015, 0.0506), (0.085, 0.0506))
    rupture = build(sheet, damage=TearingEnergy(GC, length=length)).rupture
    start = sheet.spacing, rupture._at_start, sheet.points
    notes = rupture._cuts.notes(rupture.length, 1.2, *start)
    if said is None:
        assert not notes
        return
    (note,) = notes
    assert note.startswith("a cut and the edge are 0.015 m apart, 1.2 lengths of the damage field: the edge at (")
    assert "expected a length of at most 0.0075 m" in note and ("spacing" not in note) == said


def test_cuts_that_face_nothing_start_with_the_energy_of_their_length():
    """Side by side, far from edges; beside each the profile of a crack, whose end is as far from its tip as it must."""
    sheet = square(81).cut((0.03, 0.0406), (0.07, 0.0406)).cut((0.03, 0.0594), (0.07, 0.0594))
    built = build(sheet, damage=TearingEnergy(GC, length=3.0 * sheet.spacing))
    cuts, field = built.rupture._cuts, built.rupture.field.numpy()
    assert len(cuts.ends) == 4 and not cuts.facing.any()
    assert cut_length(built, False) == pytest.approx(0.08, rel=0.02)
    x, y = sheet.points.T
    recess = cuts.recesses(built.rupture.length, sheet.spacing)[0]
    beyond = np.maximum(abs(x - 0.05) - 0.02 + recess, 0.0)
    near = (abs(y - 0.0406) < 0.009) & (y < 0.05)
    profile = np.maximum(1.0 - np.hypot(beyond, y - 0.0406) / (2.0 * built.rupture.length), 0.0) ** 2
    np.testing.assert_allclose(field[near], profile[near], atol=1e-7)


@pytest.mark.parametrize("kind", ["turned", "jittered", "with a hole"])
def test_triangles_that_a_cut_removes_leave_no_edge_at_its_end(kind):
    """The end lies inside the sheet, and the cut starts with the energy of its length, as on a whole lattice."""
    changes = {"turned": {"turn": 15.0}, "jittered": {"jitter": 0.25}}.get(kind, {})
    sheet = Sheet.filled(0.1, 0.1, thickness=1e-3, density=1000.0, points=(80, 80), **changes)
    if kind == "with a hole":
        sheet = sheet.hole((0.08, 0.08), 0.005)
    one, whole = sheet.cut((-0.01, 0.05), (0.04, 0.05)), sheet.cut((-0.01, 0.05), (0.11, 0.05))
    length = 4.0 * sheet.spacing
    cuts = CutEnds.of(one, length)
    assert cuts.ends.tolist() == [[0.04, 0.05]] and not len(CutEnds.of(whole, length).ends)
    begun, torn = (
        build(each, damage=TearingEnergy(GC, length=length)).rupture._fracture_at_start for each in (one, whole)
    )
    assert 0.1 * begun / torn == pytest.approx(0.04, rel=0.04)


def test_an_end_near_an_edge_faces_its_mirror_image():
    sheet = square(81).cut((-0.01, 0.0506), (0.07, 0.0506))
    cuts = CutEnds.of(sheet, 0.0125)
    assert cuts.ends.tolist() == [[0.07, 0.0506]]
    assert cuts.gaps == pytest.approx([0.06])
    assert cuts.recesses(2.0e-3, 1e-5) == pytest.approx([CAP * 2.0e-3], rel=1e-2)
    assert cuts.recesses(2.0e-3, 0.5e-3) == pytest.approx([0.845 * 2.0e-3], rel=1e-2)


def test_the_energy_of_the_field_is_never_negative_as_bridges_tear():
    sheet = perforated(41)
    built = Simulation(
        sheet, BondAssociated(TensionField(NEO)), Explicit(0.02), damage=TearingEnergy(GC), initial_velocity=None
    ).build("cpu")
    built.context.run("start")
    for _ in range(20):
        built.context.run("step")
    built.context.run("frame")
    left = built.context.total(built.rupture.fracture) - built.rupture._fracture_at_start
    assert left > -1e-5 * built.rupture._fracture_at_start
