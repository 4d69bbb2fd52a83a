"""Curved sheets as shapes: points, areas, frames, families, what is refused."""

import numpy as np
import pytest
from curved_sheets import SHEETS, saddle, small_sphere, small_tube
from helpers import refused

from warp_pd import (
    BondAssociated,
    BoundaryForce,
    Explicit,
    Fixed,
    Motion,
    NeoHookean,
    Nodal,
    Sheet,
    Simulation,
    ViscoBondBased,
)
from warp_pd.families import build_families, unpack
from warp_pd.materials import Yeoh
from warp_pd.measures import TearLine
from warp_pd.shapes.roughness import rough_surface

NEO = NeoHookean(1e3, 1e5)
SOLID = {"thickness": 0.01, "density": 1000.0}


@pytest.mark.parametrize("kind", SHEETS)
def test_frames_are_orthonormal_and_normals_point_outward(kind):
    sheet = SHEETS[kind]()
    np.testing.assert_allclose(
        np.swapaxes(sheet.frames, 1, 2) @ sheet.frames, np.tile(np.eye(2), (sheet.size, 1, 1)), atol=1e-14
    )
    a, b, c = (sheet.points[sheet.triangles[:, k]] for k in range(3))
    assert ((np.cross(b - a, c - a) * sheet.normals[sheet.triangles[:, 0]]).sum(axis=1) > 0.0).all()


def test_areas_are_those_of_the_surface():
    assert small_sphere().areas.sum() == pytest.approx(4.0 * np.pi, rel=1e-13)
    assert small_tube(24, 2.0).areas.sum() == pytest.approx(4.0 * np.pi, rel=1e-13)
    open_surface = saddle()
    a, b, c = (open_surface.points[open_surface.triangles[:, k]] for k in range(3))
    assert open_surface.areas.sum() == pytest.approx(
        0.5 * np.linalg.norm(np.cross(b - a, c - a), axis=1).sum(), rel=1e-13
    )


@pytest.mark.parametrize("points", [5, 10, 20, 40])
def test_the_points_of_a_sphere_are_spread_evenly(points):
    sheet = small_sphere(points)
    sides = np.linalg.norm(sheet.points[sheet.triangles] - sheet.points[np.roll(sheet.triangles, 1, axis=1)], axis=-1)
    assert 0.8 < sides.min() / sheet.spacing and sides.max() / sheet.spacing < 1.2
    assert 0.5 * np.pi / points == pytest.approx(sides.mean(), rel=0.12)
    np.testing.assert_allclose(np.linalg.norm(sheet.points, axis=1), 1.0, rtol=1e-14)


def test_normals_of_a_triangulated_sphere_are_exact():
    sphere = small_sphere(8)
    found = Sheet.from_surface(sphere.points, sphere.triangles, **SOLID)
    np.testing.assert_allclose(found.normals, sphere.points, atol=1e-13)
    assert not found.parts


def test_edges_are_parts():
    tube = small_tube(24, 2.0)
    assert np.ptp(tube.points[tube.edges("bottom"), 2]) == 0.0 and len(tube.edges("bottom")) == 24
    np.testing.assert_array_equal(tube.edges(), np.union1d(tube.edges("bottom"), tube.edges("top")))
    assert len(saddle(9).edges("rim")) == 32
    with refused(match="edge = 'left': expected one of 'bottom', 'top', 'all'"):
        tube.edges("left")


def test_regions_have_three_coordinates():
    tube = small_tube()
    assert tube.nearest(1.0, 0.0, 0.0) == 0
    inside = tube.within((1.0, 0.0, 1.0), 0.5)
    assert (np.linalg.norm(tube.points[inside] - (1.0, 0.0, 1.0), axis=1) <= 0.5).all() and len(inside)
    np.testing.assert_array_equal(tube.where(lambda x, y, z: z == 0.0), tube.edges("bottom"))
    with refused(match="z = None: expected a number on a curved sheet"):
        tube.nearest(1.0, 0.0)
    with refused(match=r"z = 0\.0: expected None on a flat sheet"):
        Sheet.rectangle(1.0, 1.0, **SOLID).nearest(0.0, 0.0, 0.0)
    assert len(tube.inclusion((1.0, 0.0, 1.0), 0.5).inclusions) == 1


def broken_surfaces():
    sphere = small_sphere()
    mixed, inward = sphere.triangles.copy(), sphere.triangles[:, ::-1]
    mixed[0] = mixed[0, ::-1]
    alone = np.vstack([sphere.points, [(3.0, 0.0, 0.0)]])
    double, opened = np.vstack([sphere.points, (1.0 + 1e-5) * sphere.points[:1]]), sphere.triangles.copy()
    opened[tuple(np.argwhere(opened == 0)[0])] = 162
    thin = np.vstack([sphere.triangles, [(0, 1, 1)]])
    return {
        "two of them run along the edge": (sphere.points, mixed),
        "counter-clockwise seen from outside, got clockwise": (sphere.points, inward),
        r"vertices\[162\] belongs to no triangle": (alone, sphere.triangles),
        r"vertices\[0\] and vertices\[162\] coincide": (double, opened),
        "expected corners that span an area": (sphere.points, thin),
        r"vertices: expected shape \(N, 3\).* got \(162, 2\)": (sphere.points[:, :2], sphere.triangles),
        "whole numbers of shape .* with F >= 1": (sphere.points, sphere.triangles[:0]),
        "triangles contains point 162": (sphere.points, sphere.triangles + 1),
    }


@pytest.mark.parametrize("message", broken_surfaces())
def test_broken_surfaces_are_refused(message):
    with refused(match=message):
        Sheet.from_surface(*broken_surfaces()[message], **SOLID)


@pytest.mark.parametrize(
    "make",
    [
        lambda: Sheet.tube(0.0, 1.0, **SOLID),
        lambda: Sheet.tube(1.0, -1.0, **SOLID),
        lambda: Sheet.tube(1.0, 1.0, points=5, **SOLID),
        lambda: Sheet.tube(1.0, 1.0, points=(20, 2), **SOLID),
        lambda: Sheet.sphere(np.nan, **SOLID),
        lambda: Sheet.sphere(1.0, points=1, **SOLID),
        lambda: small_tube().cut((0.0, 0.0), (1.0, 1.0)),
        lambda: small_tube().hole((0.0, 0.0), 1.0),
        lambda: small_tube().turned(20.0),
        lambda: TearLine(small_tube()).direction(np.ones(len(small_tube().triangles), bool)),
    ],
)
def test_wrong_arguments_are_refused(make):
    with refused(match="expected"):
        make()


@pytest.mark.parametrize(
    ("message", "parts"),
    [
        ("force = Nodal", {"force": Nodal(NEO)}),
        ("force = ViscoBondBased", {"force": ViscoBondBased(Yeoh(1e3))}),
        ("BoundaryForce: expected a flat sheet", {"loads": [BoundaryForce(1.0)]}),
        (r"at \(1, 0, 0\) m", {"loads": [Fixed([0]), Motion([0], [0.0, 1.0], x=[0.0, 0.1])]}),
    ],
)
def test_parts_that_need_a_flat_sheet_say_so(message, parts):
    values = {"force": BondAssociated(NEO, weights="plain"), "solver": Explicit(1.0), **parts}
    with refused(match=message):
        Simulation(small_tube(), **values).build("cpu", 64)


def test_families_are_balls_in_space():
    sheet = small_sphere()
    families = build_families(sheet, 2.2, "linear")
    members = families.members_of(np.arange(sheet.size))
    apart = np.linalg.norm(sheet.points[:, None] - sheet.points, axis=-1)
    for i in (0, 50):
        near = np.flatnonzero((apart[i] <= 2.2 * sheet.spacing) & (apart[i] > 0.0))
        np.testing.assert_array_equal(members[i][members[i] >= 0], near)
        common = unpack(families.common, families.members)[i][: len(near), : len(near)]
        np.testing.assert_array_equal(common, apart[near][:, near] <= 2.2 * sheet.spacing)
    np.testing.assert_allclose(np.einsum("nkc,nca->nka", families.chords, sheet.frames), families.bonds, atol=1e-15)


def two_sides(gap, turn=0.0):
    """Two squares one above the other, joined at x = 1 by the side of a fold, or not at all if they are apart."""
    square = Sheet.rectangle(1.0, 1.0, points=11, **SOLID)
    below, above = square.positions, square.positions + (0.0, 0.0, gap)
    triangles = np.concatenate([square.triangles[:, ::-1], square.triangles + square.size])
    return np.concatenate([below, above]), triangles, square.size


def pairs_of(sheet):
    members = build_families(sheet, 2.2, "linear").members_of(np.arange(sheet.size))
    point, member = np.nonzero(members >= 0)
    return np.column_stack([point, members[point, member]])


@pytest.mark.parametrize("turned", [False, True], ids=["same normals", "opposite normals"])
def test_no_bond_joins_two_sheets_that_lie_on_each_other(turned):
    points, triangles, size = two_sides(0.08)
    if not turned:
        triangles[: len(triangles) // 2] = triangles[: len(triangles) // 2, ::-1]
    pairs = pairs_of(Sheet.from_surface(points, triangles, **SOLID))
    assert ((pairs < size).all(axis=1) | (pairs >= size).all(axis=1)).all()
    flat = pairs_of(Sheet.rectangle(1.0, 1.0, points=11, **SOLID))
    assert len(pairs) == 2 * len(flat)


@pytest.mark.parametrize("angle", [90.0, 175.0], ids=["box", "hairpin"])
def test_bonds_lead_around_a_fold(angle):
    """The edge of a box keeps all its bonds; the sides of a hairpin share those of the rows at the fold alone."""
    square, turn = Sheet.rectangle(1.0, 1.0, points=11, **SOLID), np.deg2rad(angle)
    across, along = square.points.T
    second = np.column_stack([np.cos(turn) * across, along, np.sin(turn) * across])
    beyond = across > 0.0
    number = np.where(beyond, square.size + np.cumsum(beyond) - 1, np.arange(square.size))
    points = np.concatenate([np.column_stack([-across, along, 0.0 * along]), second[beyond]])
    triangles = np.concatenate([square.triangles[:, ::-1], number[square.triangles]])
    pairs = pairs_of(Sheet.from_surface(points, triangles, spacing=0.1, **SOLID))
    if angle == 90.0:
        apart = np.linalg.norm(points[:, None] - points, axis=-1)
        assert len(pairs) == ((apart <= 0.22) & (apart > 0.0)).sum()
    else:
        distance = np.linalg.norm(points[:, [0, 2]], axis=1)[pairs]
        between = (pairs[:, 0] < square.size) != (pairs[:, 1] < square.size)
        assert distance[between].min(axis=1).max() < 0.15


def test_a_narrow_slit_carries_no_bonds():
    """Two halves of a sheet, 0.04 apart along x = 0 over most of its height."""
    x = np.concatenate([np.linspace(-0.52, -0.02, 6), np.linspace(0.02, 0.52, 6)])
    y = np.linspace(0.0, 1.5, 16)
    points = np.array([(a, b, 0.05 * a * a) for b in y for a in x])
    column, row = np.meshgrid(np.arange(11), np.arange(15))
    kept = ((column != 5) | (row < 3)).ravel()
    a = (row * 12 + column).ravel()[kept]
    triangles = np.concatenate([np.column_stack([a, a + 1, a + 13]), np.column_stack([a, a + 13, a + 12])])
    pairs = pairs_of(Sheet.from_surface(points, triangles, spacing=0.1, **SOLID))
    tail, head = points[pairs[:, 0]], points[pairs[:, 1]]
    across = (tail[:, 0] < 0.0) != (head[:, 0] < 0.0)
    low = (tail[:, 1] < 0.35) & (head[:, 1] < 0.35)
    assert across[low].any() and not across[(tail[:, 1] > 0.55) | (head[:, 1] > 0.55)].any()
    # Along one side of it all bonds are there.
    side = pairs[~across & (tail[:, 0] < 0.0)]
    expected = pairs_of(Sheet.from_surface(points[points[:, 0] < 0.0], triangles_of_half(), spacing=0.1, **SOLID))
    assert len(side) == len(expected)


def triangles_of_half():
    column, row = np.meshgrid(np.arange(5), np.arange(15))
    a = (row * 6 + column).ravel()
    return np.concatenate([np.column_stack([a, a + 1, a + 7]), np.column_stack([a, a + 7, a + 6])])


def test_roughness_is_along_the_normals():
    sheet = small_sphere()
    bumps = rough_surface(sheet, 0.1, seed=0)
    assert np.abs(np.cross(bumps, sheet.points)).max() < 1e-15 and np.abs(bumps).max() > 0.05 * sheet.spacing


def test_cracks_of_a_tube_have_their_length():
    """A ring of torn faces: half the length of its two sides."""
    tube = small_tube(48, 2.0)
    centre = tube.points[tube.triangles].mean(axis=1)
    intact = np.abs(centre[:, 2] - 1.0) > 0.6 * tube.spacing
    assert TearLine(tube).length(intact) == pytest.approx(2.0 * np.pi, rel=0.02)
    assert TearLine(tube).pieces(intact) == 2


def test_results_of_a_curved_sheet_are_written(tmp_path):
    simulation = Simulation(
        small_tube(16, 1.5), BondAssociated(NEO, weights="plain"), Explicit(1e-3, frames=2),
        pictures=lambda history, folder: draw(folder),
    )  # fmt: skip
    simulation.run(out=tmp_path / "tube", device="cpu", pictures=True, usd=True)
    names = {path.name for path in (tmp_path / "tube").iterdir()}
    assert {"frames.vtkhdf", "above.png", "space.png"} <= names and any(
        name.endswith((".usd", ".usdc")) for name in names
    )


def draw(folder):
    from warp_pd.viewer import plots

    shown = plots.frames_at(folder, [1e-3])
    assert np.ptp(shown[0].reference[:, 2]) == pytest.approx(1.5, rel=1e-6)
    plots.surfaces(folder / "space.png", shown, field="u3", label="u3 (m)")
    plots.from_above(folder / "above.png", shown, field="u3", label="u3 (m)")
