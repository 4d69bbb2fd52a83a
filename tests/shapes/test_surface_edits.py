"""Slits and holes in tubes, spheres and other curved surfaces."""

import numpy as np
import pytest
from curved_sheets import saddle, small_sphere, small_tube
from helpers import build, refused

from warp_pd import Sheet, TearingEnergy
from warp_pd.families import build_families
from warp_pd.geometry.triangulation import pieces, triangle_areas
from warp_pd.scenes import glove

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
    # They are where they were asked for, which is between points of the tube.
    np.testing.assert_allclose(SLIT.points[tips], [(1.0, 0.0, 0.8), (1.0, 0.0, 2.2)], atol=1e-12)
    assert SLIT.points[left] == pytest.approx(SLIT.points[np.sort(right)][np.argsort(SLIT.points[np.sort(right), 2])])
    assert SLIT.areas.sum() == pytest.approx(TUBE.areas.sum(), rel=1e-12)
    for face, side in ((left, -1.0), (right, 1.0)):
        own = np.isin(SLIT.triangles, np.setdiff1d(face, tips)).any(axis=1)
        assert (side * SLIT.points[SLIT.triangles[own]].mean(axis=1)[:, 1] > 0.0).all()
        inner = np.setdiff1d(face, tips)[1:-1]
        assert SLIT.areas[inner] == pytest.approx(0.5 * TUBE.areas[24 * 3])
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


@pytest.mark.parametrize("kind", ["tube", "odd tube", "sphere"])
def test_a_slit_runs_straight_in_any_direction(kind):
    """Points move onto it, and stay on the surface; the triangles there stay sound, and the areas add up."""
    sheet = small_sphere(12) if kind == "sphere" else small_tube(40 if kind == "tube" else 41, 3.0)
    start, end = ((0.9, 0.1, 0.9), (0.5, 0.9, 1.7)) if kind != "sphere" else ((0.8, -0.2, 0.5), (0.3, 0.7, 0.6))
    start, end = (np.array(p) / np.linalg.norm(p[: 3 if kind == "sphere" else 2]) for p in (start, end))
    start[2], end[2] = (p[2] if kind == "sphere" else z for p, z in ((start, 0.9), (end, 1.7)))
    slit = sheet.slit(start, end)
    faces = slit.edges("slit 1")
    up = slit.normals[[np.argmin(((slit.points - p) ** 2).sum(axis=1)) for p in (start, end)]].sum(axis=0)
    across = np.cross(up, end - start)
    away = (slit.points[faces] - start) @ across / np.linalg.norm(across)
    assert np.abs(away).max() < 0.3 * sheet.spacing and np.median(np.abs(away)) < 1e-3 * sheet.spacing
    assert min(np.linalg.norm(slit.points - p, axis=1).min() for p in (start, end)) < 1e-3 * sheet.spacing
    radius = np.linalg.norm(slit.points[:, : 3 if kind == "sphere" else 2], axis=1)
    assert np.abs(radius - 1.0).max() < 1e-3 * sheet.spacing
    ratio = triangle_areas(slit.points, slit.triangles) / triangle_areas(sheet.points, sheet.triangles)
    assert ratio.min() > 0.2 and slit.areas.sum() == pytest.approx(sheet.areas.sum(), rel=1e-3)
    pairs = bonds(slit)
    left, right = (np.setdiff1d(slit.edges(f"slit 1 {a}"), slit.edges(f"slit 1 {b}")) for a, b in
                   (("left", "right"), ("right", "left")))  # fmt: skip
    assert not (np.isin(pairs[:, 0], left) & np.isin(pairs[:, 1], right)).any()


def test_a_slit_along_the_seam_of_an_odd_tube_halves_the_areas():
    tube = small_tube(25, 3.0)
    seam = tube.points[24 + 25 * np.array([2, 8])]
    slit = tube.slit(*map(tuple, seam))
    inner = np.setdiff1d(slit.edges("slit 1"), np.intersect1d(slit.edges("slit 1 left"), slit.edges("slit 1 right")))
    assert slit.areas[inner] == pytest.approx(0.5 * tube.areas[50])


LEVELS = {
    "plane": (lambda x, y, z: z - 1.4 + 0.2 * x, small_tube(24, 3.0)),
    "ball": (lambda x, y, z: (x - 0.6) ** 2 + (y + 0.5) ** 2 + (z - 0.6) ** 2 - 0.5**2, small_sphere(12)),
}


@pytest.mark.parametrize("kind", LEVELS)
def test_a_plane_or_a_ball_cuts_a_sheet_in_two(kind):
    level, sheet = LEVELS[kind]
    slit = sheet.slit(level)
    assert pieces(slit.triangles).max() == 1 and slit.size == sheet.size + len(slit.edges("slit 1 left"))
    assert np.abs(level(*slit.points[slit.edges("slit 1")].T)).max() < 0.05 * sheet.spacing
    sides = slit.points[slit.triangles].mean(axis=1)
    positive = level(*sides.T) > 0.0
    assert positive[np.isin(slit.triangles, slit.edges("slit 1 left")).any(axis=1)].all()
    assert not positive[np.isin(slit.triangles, slit.edges("slit 1 right")).any(axis=1)].any()
    pairs, of_point = bonds(slit), np.zeros(slit.size, bool)
    of_point[slit.triangles[positive]] = True
    assert (of_point[pairs[:, 0]] == of_point[pairs[:, 1]]).all()


def test_where_limits_a_cut_and_a_path_may_close():
    half = TUBE.slit(lambda x, y, z: z - 1.4, where=lambda x, y, z: x > 0.1)
    assert pieces(half.triangles).max() == 0 and half.points[half.edges("slit 1"), 0].min() > 0.1
    lengthwise = TUBE.slit(lambda x, y, z: y - 0.05)
    assert pieces(lengthwise.triangles).max() == 1 and {"slit 1", "slit 2"} < set(lengthwise.parts)
    ring = [(np.cos(a), np.sin(a), 1.5) for a in (0.0, 2.1, 4.2, 0.0)]
    assert pieces(TUBE.slit(*ring).triangles).max() == 1


def test_a_slit_in_a_mesh_of_a_glove():
    """The blank of the scene, rolled to a palm; the slit across it ends where it was asked to."""
    flat = glove.build(spacing=8e-3).sheet
    radius, (x, y) = 0.2, flat.points.T
    turn = (x - x.mean()) / radius
    bent = np.column_stack([radius * np.sin(turn), y, radius * np.cos(turn)])
    sheet = Sheet.from_surface(bent, flat.triangles, thickness=2.5e-4, density=950.0)
    middle = flat.points[flat.edges("outline side 1")].mean(axis=0) + (0.0, 0.05)
    turns = (middle[0] + np.array([-0.02, 0.02]) - x.mean()) / radius
    ends = np.column_stack([radius * np.sin(turns), np.full(2, middle[1]), radius * np.cos(turns)])
    slit = sheet.slit(*ends)
    tips = np.intersect1d(slit.edges("slit 1 left"), slit.edges("slit 1 right"))
    assert np.abs(slit.points[tips][:, None] - ends).sum(axis=2).min(axis=0).max() < 1e-5
    assert len(slit.edges("slit 1")) > 6 and len(slit.edges("rim")) == len(sheet.edges("rim"))


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
    assert holed.thickness == pytest.approx(1.0 + 0.1 * holed.points[:, 2], rel=1e-3)
    assert 0.0 < holed.areas.sum() < sheet.areas.sum()
    rim = holed.edges("hole 1")
    assert (np.linalg.norm(holed.points[rim] - centre, axis=1) < 4.5 * sheet.spacing).all()


def test_a_tear_begins_at_the_tips_of_a_slit():
    """The damage of a crack lies along the slit, and nowhere else. It ends before the tips, which face the rims."""
    built = build(SLIT, weights="corrected", damage=TearingEnergy(300.0))
    damage = built.rupture.field.numpy()
    apart = np.abs(SLIT.points - (1.0, 0.0, 1.5)) - (0.0, 0.0, 0.7)
    apart = np.linalg.norm(np.maximum(apart, 0.0), axis=1)
    along = damage[SLIT.edges("slit 1")]
    assert along.min() > 0.3 and np.median(along) > 0.6 and along.max() == pytest.approx(0.98)
    assert not damage[apart > 2.1 * built.rupture.length].any()


@pytest.mark.parametrize(("change", "said"), [
    (lambda: TUBE.slit((1.0, 0.0, 1.0)), "slit: expected two or more positions, got 1"),
    (lambda: TUBE.slit((1.0, 0.0), (1.0, 0.0, 1.0)), r"slit: path\[0\]"),
    (lambda: TUBE.slit((1.0, 0.0, 1.0), (4.0, 0.0, 2.0)), r"slit: path\[1\] = .*: expected a place on it"),
    (lambda: TUBE.slit((1.0, 0.0, 1.0), (1.0, 0.0, 1.1)), r"slit: path\[0\] = .*1.0.* and path.*: expected places"),
    (lambda: TUBE.slit((1.0, 0.0, 1.0), (1.0, 0.0, 1.3)), ".*shorter than two edges of triangles"),
    (lambda: TUBE.slit((1.0, 0.0, 0.0), (0.0, 1.0, 0.0)), r"slit: path\[0\] to path\[1\] leaves the sheet"),
    (lambda: TUBE.slit((1.0, 0.0, 1.0), (-1.0, 0.0, 1.0)), r"slit: path\[0\] = .* and path.*: .*give more between"),
    (lambda: TUBE.slit(lambda x, y, z: z - 9.0), "slit: level.* changes its sign nowhere"),
    (lambda: TUBE.slit(lambda x, y, z: y * (z - 1.5)), "slit: level.* expected lines of zeros that do not meet"),
    (lambda: TUBE.slit(lambda x, y, z: 1.0), r"slit: level.* expected 288 numbers, got shape \(\)"),
    (lambda: TUBE.slit(lambda x, y: y), r"slit: level\(x, y, z\): TypeError: .*; expected a function of arrays"),
    (lambda: TUBE.slit((1.0, 0.0, 1.0), where=lambda x, y, z: z > 0), "slit: expected one function before where"),
    (lambda: TUBE.slit((1.0, 0.0, 1.0), (1.0, 0.0, 2.0), (1.0, 0.0, 1.5)), ".*meets itself or an edge"),
    (lambda: SLIT.slit((0.9, -0.4, 1.5), (0.9, 0.4, 1.5)),
     r"slit: path\[0\] to path\[1\] crosses 'slit 1': expected slits that do not cross"),
    (lambda: TUBE.slit(lambda x, y, z: z - 1.5).slit(lambda x, y, z: z - 1.5), "slit where .* from 'slit 1'"),
    (lambda: TUBE.slit(lambda x, y, z: z - 1.5, where=lambda x, y, z: x > 0).slit(
        lambda x, y, z: z - 1.5 - 0.25 * TUBE.spacing, where=lambda x, y, z: x > 0
    ), "slit where .* m from 'slit 1' .*: expected half a spacing or more"),
    (lambda: TUBE.inclusion((1.0, 0.0, 1.5), 0.5).slit((1.0, 0.0, 0.8), (1.0, 0.0, 2.2)),
     "slit from .* passes through a rigid inclusion at"),
    (lambda: TUBE.hole((0.0, 0.0, 1.0), 0.5), "hole at .* contains no points"),
    (lambda: TUBE.hole((0.0, 0.0, 1.0), 9.0), "hole at .* removes the whole sheet"),
    (lambda: Sheet.rectangle(1.0, 1.0, thickness=1.0, density=1.0, points=5).slit((0, 0, 0), (1, 0, 0)),
     "slit: expected a curved sheet"),
])  # fmt: skip
def test_wrong_slits_and_holes_are_refused_in_one_line(change, said):
    with refused(match=f"^{said}"):
        change()
