"""Pictures of sheets before anything runs: what is in the axes, from a bar to a million triangles."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import NEO, refused
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.image import imread
from small_runs import cli, simulate
from warp._src.context import user_modules

from warp_pd import ByRegion, Gent, InputError, Sheet, draw_sheet, together
from warp_pd.shapes.curves import Circle
from warp_pd.viewer import plots, shape_plot
from warp_pd.viewer.pictures import Shown

FLAT = {"thickness": 1e-3, "density": 1000.0}
SQUARE = [(0.0, 0.0), (0.1, 0.0), (0.1, 0.1), (0.0, 0.1)]


def drawn(sheet, **options):
    (axes,) = draw_sheet(sheet, **options).axes
    return axes


def labels(axes):
    return [text.get_text() for text in axes.get_legend().get_texts()]


def lines(axes, label):
    """Segments of the collection of that label, shape (E, 2, 2)."""
    (found,) = [c for c in axes.collections if isinstance(c, LineCollection) and c.get_label() == label]
    return np.array(found.get_segments())


def markers(axes, start):
    """Places of the markers whose label begins so, shape (N, 2 or 3)."""
    (found,) = [line for line in axes.lines if line.get_label().startswith(start)]
    return np.column_stack(found.get_data_3d() if hasattr(found, "get_data_3d") else found.get_data())


def rubber_at(axes, places):
    """Whether the pixel at each place is not white."""
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    canvas = FigureCanvasAgg(axes.figure)
    canvas.draw()
    picture = np.asarray(canvas.buffer_rgba())
    pixels = np.round(axes.transData.transform(places)).astype(int)
    return [bool(picture[-1 - y, x, :3].min() < 255) for x, y in pixels]


def lengths(segments):
    return np.linalg.norm(segments[:, 1] - segments[:, 0], axis=1)


def tube(around=24, along=11, radius=0.02, length=0.1):
    angle, z = np.meshgrid(np.arange(around) * 2 * np.pi / around, np.linspace(0.0, length, along))
    points = np.column_stack([radius * np.cos(angle.ravel()), radius * np.sin(angle.ravel()), z.ravel()])
    i, j = (k.ravel() for k in np.meshgrid(np.arange(around), np.arange(along - 1)))
    a, b = i + around * j, (i + 1) % around + around * j
    triangles = np.concatenate([np.column_stack([a, b, b + around]), np.column_stack([a, b + around, a + around])])
    return Sheet(
        points=points, areas=np.full(len(points), 1e-5), triangles=triangles.astype(np.int32), spacing=5e-3,
        parts={"mouth": np.arange(around)}, **FLAT,
    )  # fmt: skip


def test_a_rectangle_with_a_cut_and_an_inclusion():
    sheet = Sheet.rectangle(0.1, 0.05, points=21, **FLAT).cut((0.0525, -0.01), (0.0525, 0.0252))
    axes = drawn(sheet.inclusion((0.08, 0.025), 0.011), title="mine")
    assert axes.get_title().split("\n") == ["mine", "0.1 x 0.05 m, 231 points, 389 triangles, spacing 0.005 m"]
    assert set(labels(axes)) == {"triangles", "boundary", "rigid inclusion 1, 13 points", "cuts", "231 points"}
    # The points at its tips are the corner of no triangle inside it.
    assert len(markers(axes, "rigid inclusion 1")) == 13
    assert len(lines(axes, "triangles")) == 231 + 389 - 1  # Euler: one piece without a hole.
    # The rectangle, and both sides of the slit that the cut took out of the triangles.
    assert lengths(lines(axes, "boundary")).sum() == pytest.approx(0.3 + 2 * 0.03, rel=0.1)
    assert lines(axes, "cuts").tolist() == [[[0.0525, -0.01], [0.0525, 0.0252]]]
    assert np.array_equal(markers(axes, "231 points"), sheet.points)
    (rigid,) = [c for c in axes.collections if isinstance(c, PolyCollection)]
    assert len(rigid.get_paths()) == 8
    assert axes.get_aspect() == 1.0 and axes.get_xlim()[0] < 0.0 and axes.get_xlim()[1] > 0.1


def test_an_outline_with_everything():
    """Points on the grid apart from others, names of all parts, a hole that is not filled, a crack that is open."""
    sheet = Sheet.outline(
        SQUARE, holes={"drill": Circle((0.03, 0.03), 0.015)}, cracks={"slit": [(0.1, 0.07), (0.06, 0.07)]},
        spacing=4e-3, **FLAT,
    )  # fmt: skip
    axes = drawn(sheet)
    on = sheet.grid[:, 0] >= 0
    assert np.array_equal(markers(axes, f"{on.sum()} points on the grid"), sheet.points[on])
    assert len(markers(axes, f"{(~on).sum()} other points")) == (~on).sum()
    for name, points in sheet.parts.items():
        # All of the edge is drawn as the boundary.
        assert (f"{name}, {len(points)} points" in labels(axes)) == (name != "all")
    assert np.allclose(markers(axes, "drill, "), sheet.points[sheet.parts["drill"]])
    places = [(0.0301, 0.0302), (0.0501, 0.0502), (0.1021, 0.0501), (0.0502, 0.0101)]
    assert rubber_at(axes, places) == [False, True, False, True]
    # Two faces at one place would hide each other.
    above, below = markers(axes, "slit left, "), markers(axes, "slit right, ")
    inner = above[:, 0] < 0.099
    gap = np.abs(above[inner, 1].mean() - below[inner, 1].mean())
    assert 0.1 * sheet.spacing < gap < 0.4 * sheet.spacing
    assert np.abs(above[:, 1] - 0.07).max() < 0.3 * sheet.spacing


def test_names_that_edits_keep_of_edges_are_not_in_the_legend():
    """What the user or a maker has named is, such as the rims of a tube or a group of a file."""
    sheet = Sheet.rectangle(0.1, 0.05, points=11, **FLAT)
    edited = (sheet.turned(30.0), sheet.as_cloud(), sheet.hole((0.05, 0.025), 0.012))
    for each, named in zip(edited, ((), (), ("hole 1",)), strict=True):
        assert {"left", "all"} <= set(each.parts)
        assert [text.split(",")[0] for text in labels(drawn(each))[3:]] == list(named)
    beside = labels(drawn(together(sheet, sheet.turned(30.0))))
    assert {text.split(",")[0] for text in beside[3:]} == {"sheet 1", "sheet 2"}
    rims = labels(drawn(Sheet.tube(0.02, 0.05, points=16, **FLAT).as_cloud()))
    assert [text.split(",")[0] for text in rims[-2:]] == ["bottom", "top"]
    assert "left, 3 points" in labels(drawn(replace(sheet.as_cloud(), parts={"left": np.arange(3)})))


def test_pieces_graded_spacing_and_many_parts():
    points = np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [3.0, 0.0], [4.0, 0.0], [3.0, 1.0]])
    sheet = Sheet.from_points(points, triangles=np.array([[0, 1, 2], [3, 4, 5]]), **FLAT)
    names = {f"part {k}": np.array([k % 6]) for k in range(25)}
    axes = drawn(replace(sheet, parts=names, spacings=np.linspace(0.1, 0.5, 6)))
    assert axes.get_title() == "4 x 1 m, 6 points, 2 triangles, spacing 0.1 to 0.5 m, 2 pieces"
    assert labels(axes)[-1] == f"{25 - shape_plot.MAX_PARTS} more parts" and len(labels(axes)) == 3 + 19


@pytest.mark.parametrize("curved", [False, True])
def test_stiffened_points_are_shown_with_their_factor(curved):
    sheet = tube() if curved else Sheet.rectangle(0.1, 0.1, points=11, **FLAT)
    axes = drawn(sheet.stiffened([3, 4, 5], 2.5).stiffened([5], 4.0))
    assert np.allclose(markers(axes, "2.5 times as stiff, 2 points"), sheet.positions[[3, 4], : 2 + curved])
    assert np.allclose(markers(axes, "10 times as stiff, 1 points"), sheet.positions[[5], : 2 + curved])


@pytest.mark.parametrize("curved", [False, True])
def test_regions_of_materials_are_shown(curved):
    sheet = tube() if curved else Sheet.rectangle(0.1, 0.1, points=11, **FLAT).as_cloud()
    half = sheet.positions[:, 0] > 0.0101
    simulation = simulate(sheet, material=ByRegion(NEO, [(half, Gent(mu=2e6, bulk=1e9, lock=50.0))]))
    (axes,) = simulation.draw().axes
    assert np.allclose(markers(axes, f"region 1: Gent, {half.sum()} points"), sheet.positions[half, : 2 + curved])


def test_pictures_of_a_run_outline_the_regions():
    """Of a region that is torn off at its right, only what its triangles still span."""
    sheet = Sheet.rectangle(0.1, 0.1, points=11, **FLAT)
    frame = Shown("", sheet.positions, sheet.positions, sheet.triangles, {})
    region = sheet.where(lambda x, y: (x > 0.049) & (y > 0.049))
    outlines = [plots._outlines(replace(frame, regions=r)) for r in ([], [region], [region, sheet.edges("left")])]
    assert [len(edges) for edges, _ in outlines] == [40, 60, 60]
    torn = sheet.triangles[sheet.points[sheet.triangles].mean(axis=1)[:, 0] < 0.08]
    edges, owners = plots._outlines(replace(frame, triangles=torn, regions=[region]))
    assert len(edges) == 36 + 16 and owners.max() < len(torn)


def test_the_shorter_side_of_a_strip_can_be_seen():
    for width, height, name in ((0.5, 0.01, "y"), (0.01, 0.5, "x")):
        axes = drawn(Sheet.rectangle(width, height, points=101 if width > height else 3, **FLAT))
        assert axes.get_title().split("\n")[-1] == f"{name} drawn 7.5 times as large"
        box = axes.get_position().size * axes.figure.get_size_inches()
        assert box.min() > 0.14 * box.max() and box.min() > 0.5
    assert "drawn" not in drawn(Sheet.rectangle(0.5, 0.1, points=51, **FLAT)).get_title()


def test_a_bar():
    axes = drawn(Sheet.line(1.0, 1e-4, density=1.0, points=20))
    assert labels(axes) == ["20 points"] and np.diff(axes.get_ylim())[0] > 0.0


@pytest.mark.parametrize("points", [5, 301])
def test_markers_and_triangles_stay_legible(points):
    """Many points: some markers, said so; the area and the boundary are complete."""
    sheet = Sheet.rectangle(1.0, 1.0, points=points, **FLAT).hole((0.5, 0.5), 0.3)
    axes = drawn(sheet)
    many = sheet.size > shape_plot.MAX_MARKERS
    shown = markers(axes, f"{sheet.size} points on the grid")
    assert len(shown) == (shape_plot.MAX_MARKERS if many else sheet.size)
    assert (f"{sheet.size} points on the grid, {shape_plot.MAX_MARKERS} shown" in labels(axes)) == many
    assert ("triangles" in labels(axes)) == (not many)
    if many:
        # Spread over the sheet, in no pattern: every tenth of it has its share of the markers.
        count, _ = np.histogram(shown[:, 0], bins=10, range=(0.0, 1.0))
        whole, _ = np.histogram(sheet.points[:, 0], bins=10, range=(0.0, 1.0))
        assert np.abs(count / whole * sheet.size / len(shown) - 1.0).max() < 0.15
        ring = lengths(lines(axes, "boundary")).sum() - 4.0
        assert 2 * np.pi * 0.3 < ring < 8 * 0.3 * 1.01  # a staircase
    assert rubber_at(axes, [(0.501, 0.502), (0.101, 0.102), (0.5, 1.02)]) == [False, True, False]


def test_a_curved_sheet():
    sheet = replace(tube(), inclusions=(np.arange(100, 110),))
    axes = drawn(sheet, view=(10.0, 20.0))
    assert axes.name == "3d" and (axes.elev, axes.azim) == (10.0, 20.0)
    assert axes.get_title() == "0.04 x 0.04 x 0.1 m, 264 points, 480 triangles, spacing 0.005 m"
    assert labels(axes) == ["triangles", "boundary", "rigid inclusion 1, 10 points", "264 points", "mouth, 24 points"]
    assert np.allclose(markers(axes, "264 points"), sheet.points)
    assert np.allclose(markers(axes, "mouth"), sheet.points[:24])
    assert np.allclose(markers(axes, "rigid"), sheet.points[100:110])
    surface, boundary = axes.collections
    axes.figure.draw_without_rendering()
    assert len(surface.get_paths()) == 480 and len(boundary.get_segments()) == 48
    assert axes._box_aspect[2] / axes._box_aspect[0] == pytest.approx(2.5)


def test_a_large_curved_sheet_has_fewer_triangles_of_the_same_surface():
    sheet = tube(around=320, along=380)
    corners = shape_plot._coarse(sheet.points, sheet.triangles)
    assert 5_000 < len(corners) < 40_000 < len(sheet.triangles)
    area = 0.5 * np.linalg.norm(np.cross(corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]), axis=1).sum()
    assert area == pytest.approx(2 * np.pi * 0.02 * 0.1, rel=0.08)
    assert "triangles, joined to larger ones" in labels(drawn(sheet))


@pytest.mark.parametrize(("radius", "length"), [(0.02, 0.06), (0.02, 0.02), (0.1, 0.03)])
def test_coordinates_of_a_curved_sheet_do_not_collide(radius, length):
    from matplotlib.backends.backend_agg import FigureCanvasAgg

    axes = drawn(tube(32, 12, radius, length))
    FigureCanvasAgg(axes.figure).draw()
    every = [axis.get_majorticklabels() for axis in (axes.xaxis, axes.yaxis, axes.zaxis)]
    assert min(len(labels) for labels in every) >= 1
    boxes = [label.get_window_extent() for labels in every for label in labels if label.get_text()]
    assert not [1 for k, a in enumerate(boxes) for b in boxes[:k] if a.overlaps(b)]


def test_points_behind_a_closed_surface_are_hidden():
    corners = np.array([[1, 0, 0], [0, 1, 0], [0, 0, 1], [-1, 0, 0], [0, -1, 0], [0, 0, -1]], float)
    faces = [(0, 1, 2), (1, 3, 2), (3, 4, 2), (4, 0, 2), (1, 0, 5), (3, 1, 5), (4, 3, 5), (0, 4, 5)]
    axes = drawn(Sheet.from_surface(corners, np.array(faces), **FLAT), view=(30.0, 45.0))
    assert markers(axes, "6 points").tolist() == corners[:3].tolist()
    assert "boundary" not in labels(axes)


@pytest.mark.parametrize("suffix", ["png", "svg"])
def test_files(tmp_path, suffix):
    path = tmp_path / f"sheet.{suffix}"
    figure = simulate(Sheet.rectangle(1.0, 1.0, points=5, **FLAT)).draw(path)
    assert figure.axes[0].get_title().startswith("simulation\n")
    assert path.stat().st_size > 1000 and [p.name for p in tmp_path.iterdir()] == [path.name]
    if suffix == "png":
        picture = imread(path)[:, :, :3]
        # White around it on all sides: no label is cut.
        for side in (picture[0], picture[-1], picture[:, 0], picture[:, -1]):
            assert side.min() == 1.0


def test_wrong_arguments(tmp_path):
    sheet = Sheet.rectangle(1.0, 1.0, points=5, **FLAT)
    for path, text in (
        ("a.jpg", "path = 'a.jpg': expected a name that ends in .png, .pdf, .svg"),
        (tmp_path / "none" / "a.png", "expected a folder that can be written"),
        (3, "path = 3: expected the path of a picture or None"),
    ):
        with pytest.raises(InputError) as error:
            draw_sheet(sheet, path)
        assert text in str(error.value)
    with refused(match="sheet = 3: expected a Sheet"):
        draw_sheet(3)


def test_command_line(tmp_path, monkeypatch):
    """The sheet of a scene is drawn before it runs; no kernel is compiled."""
    monkeypatch.chdir(tmp_path)
    loaded = {module for module in user_modules.values() if module.execs}
    done = cli("draw", "pressure", "--shape", "--points", "7")
    assert {module for module in user_modules.values() if module.execs} == loaded
    assert done.exit_code == 0 and done.output.split() == ["pressure-shape.png"]
    assert imread(tmp_path / "pressure-shape.png").shape[0] > 500
    (tmp_path / "mine.py").write_text(
        "from warp_pd import *\n"
        "def build(radius=0.2):\n"
        "    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=15).hole((0.5, 0.5), radius)\n"
        "    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5)), Explicit(0.1, frames=2))\n"
    )
    done = cli("draw", "mine.py", "--shape", "--set", "radius=0.3", "--out", "hole.svg")
    assert done.exit_code == 0 and "mine" in (tmp_path / "hole.svg").read_text()


@pytest.mark.parametrize(
    ("arguments", "text"),
    [
        (["none.py", "--shape"], "the file does not exist"),
        (["pressure", "--shape", "--set", "point=3"], "did you mean 'points'"),
        (["pressure", "--shape", "--scene", "a.py"], "--scene a.py: expected only without --shape"),
        (["pressure", "--shape", "--pictures", "pdf"], "--pictures: expected only without --shape; the"),
        (["pressure"], "expected a folder with the summary.json of a run, or --shape"),
        (["pressure", "--points", "7"], "--points: expected only with --shape"),
        (["pressure", "--set", "points=7"], "--set: expected only with --shape"),
        (["pressure", "--out", "a.png"], "--out: expected only with --shape"),
    ],
)
def test_wrong_command_lines(tmp_path, monkeypatch, arguments, text):
    monkeypatch.chdir(tmp_path)
    done = cli("draw", *arguments)
    assert done.exit_code == 2
    (line,) = [line for line in done.output.splitlines() if line.startswith("warp-pd:")]
    assert text in line and not list(tmp_path.iterdir())
