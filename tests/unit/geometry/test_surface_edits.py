"""Slits and holes in tubes, spheres and other curved surfaces."""

import numpy as np
import pytest
from curved_sheets import saddle, small_sphere, small_tube
from helpers import build

from warp_pd import InputError, Sheet, TearingEnergy
from warp_pd.families import build_families

TUBE = small_tube(24, 3.0)
SLIT = TUBE.slit((1.0, 0.0, 0.8), (1.0, 0.0, 2.2))


def bonds(sheet, horizon=2.015):
    families = build_families(sheet, horizon, "linear")
    tail, slot = np.nonzero(families.exists)
    return np.column_stack([tail, families.neighbours[tail, slot]])


def test_points_on_a_slit_become_two_and_its_tips_stay_one():
    left, right = SLIT.edges("slit 1 left"), SLIT.edges("slit 1 right")
    tips = np.intersect1d(left, right)
    assert len(tips) == 2 and SLIT.size == TUBE.size + len(left) - 2
    assert SLIT.points[left] == pytest.approx(SLIT.points[np.sort(right)][np.argsort(SLIT.points[np.sort(right), 2])])
    assert SLIT.areas.sum() == pytest.approx(TUBE.areas.sum(), rel=1e-12)
    for face, side in ((left, -1.0), (right, 1.0)):
        own = np.isin(SLIT.triangles, np.setdiff1d(face, tips)).any(axis=1)
        assert (side * SLIT.points[SLIT.triangles[own]].mean(axis=1)[:, 1] > 0.0).all()
        assert SLIT.areas[np.setdiff1d(face, tips)] == pytest.approx(0.5 * TUBE.areas[24 * 3])
    assert set(TUBE.parts) < set(SLIT.parts)


def test_no_bond_crosses_a_slit():
    pairs = bonds(SLIT)
    before, after = SLIT.points[pairs].transpose(1, 0, 2)
    z = 0.5 * (before[:, 2] + after[:, 2])
    tips = SLIT.points[np.intersect1d(SLIT.edges("slit 1 left"), SLIT.edges("slit 1 right")), 2]
    near = (before[:, 0] > 0.0) & (z > tips.min() + 0.1) & (z < tips.max() - 0.1)
    assert near.any() and not (near & (before[:, 1] * after[:, 1] < -1e-12)).any()
    for face, side in (("slit 1 left", -1.0), ("slit 1 right", 1.0)):
        inner = np.setdiff1d(SLIT.edges(face), np.flatnonzero(np.isin(SLIT.points[:, 2], tips)))
        heads = SLIT.points[pairs[np.isin(pairs[:, 0], inner), 1], 1]
        assert (side * heads > -1e-12).all() and (side * heads > 0.1).any()


@pytest.mark.parametrize("horizon", [2.015, 3.015])
def test_a_slit_in_a_flat_surface_leaves_the_bonds_of_a_crack(horizon):
    """The same points as a crack in an outline; both let bonds pass around a tip by a fifth of their length."""
    flat = Sheet.outline(
        [(0, 0), (1, 0), (1, 1), (0, 1)], cracks=[[(0.3, 0.5), (0.7, 0.5)]], spacing=0.1, thickness=0.01, density=1e3
    )
    whole = Sheet.outline([(0, 0), (1, 0), (1, 1), (0, 1)], spacing=0.1, thickness=0.01, density=1e3)
    curved = Sheet.from_surface(whole.positions, whole.triangles, thickness=0.01, density=1e3, spacing=0.1)
    slit = curved.slit((0.3, 0.5, 0.0), (0.7, 0.5, 0.0))

    def lengths(sheet):
        """Ends of all bonds, to compare whatever the order of the points; of a pair of copies, both."""
        pairs = bonds(sheet, horizon)
        return sorted(map(tuple, np.round(sheet.positions[pairs].reshape(-1, 6), 9)))

    assert slit.size == flat.size
    assert lengths(slit) == lengths(flat.as_cloud())


def test_a_slit_may_turn_and_begin_at_an_edge():
    sheet = TUBE.slit((1.0, 0.0, 0.0), (1.0, 0.0, 1.0), (0.0, 1.0, 1.0))
    assert np.intersect1d(sheet.edges("slit 1 left"), sheet.edges("slit 1 right")).size == 1
    assert len(sheet.edges("bottom")) == len(TUBE.edges("bottom")) + 1
    twice = SLIT.slit((-1.0, 0.0, 0.8), (-1.0, 0.0, 2.2))
    assert len(twice.edges("slit 2")) == len(twice.edges("slit 1"))


@pytest.mark.parametrize("sheet", [small_sphere(8), TUBE, saddle()], ids=["sphere", "tube", "saddle"])
def test_a_hole_takes_what_is_inside_a_ball(sheet):
    thick = Sheet.from_surface(
        sheet.points, sheet.triangles, thickness=lambda x, y, z: 1.0 + 0.1 * z, density=1e3
    ).slit(sheet.points[sheet.triangles[0, 0]], sheet.points[len(sheet.points) // 2])
    centre = sheet.points[len(sheet.points) // 3]
    holed = thick.hole(tuple(centre), 2.1 * sheet.spacing)
    assert np.linalg.norm(holed.points - centre, axis=1).min() >= 2.1 * sheet.spacing * (1.0 - 1e-9)
    assert holed.thickness == pytest.approx(1.0 + 0.1 * holed.points[:, 2])
    assert 0.0 < holed.areas.sum() < sheet.areas.sum()
    rim = holed.edges("hole 1")
    assert (np.linalg.norm(holed.points[rim] - centre, axis=1) < 4.5 * sheet.spacing).all()


def test_a_tear_begins_at_the_tips_of_a_slit():
    """The damage of a crack lies along the whole slit, and nowhere else."""
    built = build(SLIT, weights="corrected", damage=TearingEnergy(300.0))
    damage = built.rupture.field.numpy()
    apart = np.abs(SLIT.points - (1.0, 0.0, 1.5)) - (0.0, 0.0, 0.7)
    apart = np.linalg.norm(np.maximum(apart, 0.0), axis=1)
    assert damage[SLIT.edges("slit 1")].min() > 0.5
    assert not damage[apart > 2.1 * built.rupture.length].any()


@pytest.mark.parametrize(("change", "said"), [
    (lambda: TUBE.slit((1.0, 0.0, 1.0)), "slit: expected two or more positions, got 1"),
    (lambda: TUBE.slit((1.0, 0.0), (1.0, 0.0, 1.0)), r"slit: path\[0\]"),
    (lambda: TUBE.slit((1.0, 0.0, 1.0), (4.0, 0.0, 2.0)), r"slit: path\[1\] = .*: expected a place on the sheet"),
    (lambda: TUBE.slit((1.0, 0.0, 1.0), (1.0, 0.0, 1.1)), ".*shorter than two edges of triangles"),
    (lambda: TUBE.slit((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), ".*meets itself or an edge"),
    (lambda: TUBE.slit((1.0, 0.0, 1.0), (1.0, 0.0, 2.0), (1.0, 0.0, 1.5)), ".*meets itself or an edge"),
    (lambda: TUBE.hole((0.0, 0.0, 1.0), 0.5), "hole at .* contains no points"),
    (lambda: TUBE.hole((0.0, 0.0, 1.0), 9.0), "hole at .* removes the whole sheet"),
    (lambda: Sheet.rectangle(1.0, 1.0, thickness=1.0, density=1.0, points=5).slit((0, 0, 0), (1, 0, 0)),
     "slit: expected a curved sheet"),
])  # fmt: skip
def test_wrong_slits_and_holes_are_refused_in_one_line(change, said):
    with pytest.raises(InputError, match=f"^{said}") as caught:
        change()
    assert "\n" not in str(caught.value)
