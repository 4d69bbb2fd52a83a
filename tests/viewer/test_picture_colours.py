"""Pictures as a paper takes them: colours of the bar, zero in the middle, labels that do not collide, formats."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from helpers import refused
from matplotlib import colormaps
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.image import imread
from matplotlib.text import Text

from warp_pd import Sheet, Sphere
from warp_pd.output.quantities import column_label, column_unit, field_label
from warp_pd.run.folder import picture_formats, pictures_in
from warp_pd.viewer import pictures, plots
from warp_pd.viewer.painter import View, material_lines, places_of, scale_of, strokes
from warp_pd.viewer.pictures import Shown


def sheet_shown(points=21, lift=0.0, width=1.0, height=1.0, **fields):
    """A frame of a sheet that is lifted in its middle, or of a tilted one."""
    sheet = Sheet.rectangle(width, height, thickness=1e-3, density=1e3, points=points)
    x, y = (sheet.points / (width, height)).T
    bump = lift * np.sin(np.pi * x) * np.sin(np.pi * y)
    moved = sheet.positions + np.column_stack([0 * bump, 0 * bump, bump])
    made = {"u3": bump, "damage": np.zeros(sheet.size), **fields}
    return Shown("t = 1 s", moved, sheet.positions, sheet.triangles, made, scene="lifted")


def figure_of(monkeypatch, draw, *arguments, **options):
    """The figure that a function of `plots` makes, drawn but in no file."""
    kept = []
    # A file has pixels; the test asks for the texts and boxes of the figure.
    monkeypatch.setattr(plots, "save", lambda figure, path, **more: kept.append(figure))
    draw(None, *arguments, **options)
    FigureCanvasAgg(kept[0]).draw()
    return kept[0]


def test_places_without_a_value_are_grey_and_leave_the_scale_alone():
    frame = sheet_shown(joint_damage=np.where(np.arange(441) < 200, np.nan, 0.5))
    scale = scale_of([frame], "joint_damage", "", None)
    assert (scale.low, scale.high) == (0.5, 1.5)
    assert scale.colours(np.array([np.nan]))[0] == pytest.approx([0.72, 0.72, 0.72, 1.0])
    nothing = sheet_shown(joint_damage=np.full(441, np.nan))
    assert scale_of([nothing], "joint_damage", "", None).shown == (0.0, 1.0)


@pytest.mark.parametrize("picture", [plots.surfaces, plots.from_above])
@pytest.mark.parametrize("damage", [0.0, 0.5])
def test_a_sheet_has_the_colour_of_the_bar(picture, damage, tmp_path):
    """Whatever its slope: most pixels that are neither white nor a line have exactly that colour."""
    frame = sheet_shown(lift=0.3)
    frame.fields["damage"] += damage
    picture(tmp_path / "a.png", [frame], "damage", limits=(0.0, 1.0))
    pixels = np.round(255 * imread(tmp_path / "a.png")[:, :800, :3]).astype(int).reshape(-1, 3)
    coloured = pixels[pixels.min(axis=1) < 255]
    found, times = np.unique(coloured, axis=0, return_counts=True)
    expected = np.round(255 * np.array(colormaps["inferno_r"](damage)[:3]))
    assert np.abs(found[times.argmax()] - expected).max() <= 1
    assert times.max() > 0.5 * len(coloured)


def test_signed_fields_have_zero_in_the_middle():
    frame = sheet_shown()
    frame.fields["u3"] = np.linspace(-1.0, 3.0, len(frame.points))
    scale = scale_of([frame], "u3", "", None)
    assert (scale.name, scale.low, scale.high, scale.shown) == ("coolwarm", -3.0, 3.0, (-1.0, 3.0))
    red, green, blue, _ = scale.colours(np.array(0.0))
    assert max(red, green, blue) - min(red, green, blue) < 0.02, "zero is grey"
    for sign, name in ((1.0, "viridis"), (-1.0, "viridis_r")):
        frame.fields["u3"] = sign * np.linspace(0.0, 1.0, len(frame.points))
        one = scale_of([frame], "u3", "", None)
        assert one.name == name
        assert np.allclose(one.colours(np.array(0.0)), colormaps["viridis"](0.0), atol=0.02)
    assert scale_of([frame], "damage", "", None).shown == (0.0, 1.0)


def test_panels_share_one_scale_and_the_bar_ends_with_the_values(monkeypatch):
    frames = [sheet_shown(lift=0.1), sheet_shown(lift=0.3)]
    figure = figure_of(monkeypatch, plots.surfaces, frames, "u3")
    bar = figure.axes[-1]
    assert bar.get_ylim() == pytest.approx((0.0, 0.3))
    assert bar.get_ylabel() == "displacement along z (m)"
    assert figure.get_suptitle() == "lifted"
    first, second = (axes.images[0].get_array() for axes in figure.axes[:2])
    # Yellow is at the high end of the scale.
    assert [int(image[image[..., 3] > 0][:, 0].max() > 200) for image in (first, second)] == [0, 1]


@pytest.mark.parametrize(
    ("view", "width", "height", "lift", "panels"),
    [
        ((28.0, -60.0), 0.2, 1.0, 0.1, 4), ((25.0, -115.0), 1.0, 0.2, 0.5, 4), ((35.0, -70.0), 1.0, 1.0, 0.01, 1),
        ((10.0, 30.0), 1.0, 1.0, 2.0, 4),
    ],
)  # fmt: skip
def test_no_two_labels_overlap(view, width, height, lift, panels, monkeypatch):
    frames = [sheet_shown(9, lift, width, height)] * panels
    figure = figure_of(monkeypatch, plots.surfaces, frames, "u3", view=view)
    texts = [t for axes in figure.axes[:panels] for t in [*axes.texts, axes.title]]
    texts += [
        figure._suptitle,
        *(t for t in figure.axes[-1].findobj(Text) if t.get_text() == "displacement along z (m)"),
    ]
    boxes = [t.get_window_extent() for t in texts]
    assert len(boxes) > 6 * panels
    clashes = [
        (a.get_text(), b.get_text())
        for (a, p), (b, q) in itertools.combinations(zip(texts, boxes, strict=True), 2)
        if p.overlaps(q)
    ]
    assert not clashes
    whole = figure.bbox
    assert all(b.x0 >= 0 and b.y0 >= 0 and b.x1 <= whole.x1 and b.y1 <= whole.y1 for b in boxes), "cut off"


def test_a_tall_panel_has_room_for_the_labels_beside_it(monkeypatch):
    """A tube on end, whose panel leaves room free at its sides."""
    frame = sheet_shown(17)
    x, y = frame.points[:, :2].T
    tube = np.column_stack([0.021 * np.cos(2.0 * np.pi * x), 0.021 * np.sin(2.0 * np.pi * x), 0.069 * y])
    bar = {"label": "displacement along x (m)", "limits": (-0.0008, 0.0009)}
    figure = figure_of(monkeypatch, plots.surfaces, [replace(frame, points=tube)], "u3", view=(15.0, -80.0), **bar)
    assert min(text.get_window_extent().x0 for text in figure.axes[0].texts) >= 0.0


@pytest.mark.parametrize(("width", "height", "lift"), [(1.0, 1.0, 0.2), (0.2, 0.2, 1.0), (2.0, 0.5, 0.1)])
def test_the_sheet_fills_the_picture(width, height, lift, monkeypatch):
    """One panel: what is drawn reaches over the panel, and the panel over most of the picture."""
    frame = sheet_shown(21, lift, width, height)
    figure = figure_of(monkeypatch, plots.surfaces, [frame], "u3")
    axes = figure.axes[0]
    painted = np.flatnonzero(axes.images[0].get_array()[..., 3].any(axis=0))
    assert np.ptp(painted) > 0.95 * axes.images[0].get_array().shape[1]
    box = axes.get_window_extent()
    assert box.width * box.height > 0.3 * figure.bbox.width * figure.bbox.height


def test_a_sheet_that_hides_another_is_drawn_last(tmp_path):
    """Two sheets above each other, the upper one damaged: its colour covers the lower one's, seen from above."""
    low, high = sheet_shown(5), sheet_shown(5)
    n = len(low.points)
    both = replace(
        low,
        points=np.vstack([high.points + (0, 0, 0.1), low.points]),
        reference=np.vstack([low.reference, low.reference]),
        triangles=np.vstack([high.triangles, low.triangles + n]),
        fields={"damage": np.repeat([1.0, 0.0], n)},
    )
    for picture in (plots.from_above, lambda *a, **k: plots.surfaces(*a, **k, view=(90.0, -90.0))):
        picture(tmp_path / "a.png", [both], "damage", limits=(0.0, 1.0))
        pixels = np.round(255 * imread(tmp_path / "a.png")[:, :500, :3]).astype(int).reshape(-1, 3)
        hidden = np.round(255 * np.array(colormaps["inferno_r"](0.0)[:3]))
        assert (np.abs(pixels - hidden).max(axis=1) <= 1).mean() < 0.01


def test_pictures_from_above_mark_bodies_too_thin_to_see(monkeypatch):
    """A pin is marked where it is; a ball would hide the sheet, and neither is where the reference sheet is."""
    vertices, triangles = Sphere(0.01).outline(0.0)
    vertices = vertices + (0.3, 0.6, 0.1)
    frame = replace(sheet_shown(5), bodies=[(vertices, triangles), (20.0 * vertices, triangles)])
    marks = figure_of(monkeypatch, plots.from_above, [frame], "u3").axes[0].lines
    np.testing.assert_allclose([mark.get_xydata()[0] for mark in marks], [(0.3, 0.6)], atol=1e-3)
    assert not figure_of(monkeypatch, plots.reference, [frame], "u3").axes[0].lines


def test_lines_of_the_material_lie_on_the_deformed_sheet():
    frame = sheet_shown(13, lift=0.2)
    lines, owners = material_lines(frame)
    # On each of the eleven levels along x and along y the segments have the length of the sheet, on the bump more.
    length = np.linalg.norm(lines[:, 1] - lines[:, 0], axis=1).sum()
    assert 22.0 < length < 26.0
    # Each lies on its triangle: its ends are sums of the corners.
    corners = frame.points[frame.triangles[owners]]
    spans = np.concatenate([corners[:, :2] - corners[:, 2:], lines - corners[:, 2:]], axis=1)
    assert (np.linalg.matrix_rank(spans, tol=1e-9) <= 2).all()
    flat, _ = material_lines(replace(frame, points=frame.reference))
    assert np.linalg.norm(flat[:, 1] - flat[:, 0], axis=1).sum() == pytest.approx(22.0, rel=1e-6)


def test_a_projection_keeps_lengths_and_right_angles():
    view = View.of(np.zeros(3), np.array([1.0, 2.0, 1.0]), 28.0, -60.0)
    assert np.allclose(view.axes @ view.axes.T, np.eye(3), atol=1e-14)
    assert np.linalg.det(view.axes) == pytest.approx(1.0)
    assert view.seen(np.array([0.0, 0.0, 1.0]))[1] > 0.0, "z is up"
    flat = View.of(np.zeros(3), np.array([1.0, 1.0, 0.0]), 28.0, -60.0)
    assert flat.grown.tolist() == [1.0, 1.0, 1.0] and [edge[0] for edge in flat.edges()] == [0, 1]


def test_a_plane_below_a_sheet_does_not_widen_the_picture_and_a_far_ball_little():
    plane = 10.0 * np.array([[-1.0, -1.0, -0.05], [1.0, -1.0, -0.05], [0.0, 1.0, -0.05]])
    far = np.array([[0.5, 0.5, 3.0], [0.6, 0.5, 3.0], [0.5, 0.6, 3.0]])
    one = np.array([[0, 1, 2]])
    places = places_of(replace(sheet_shown(9), bodies=((plane, one), (far, one))))
    assert places.min(axis=0) == pytest.approx([0.0, 0.0, 0.0], abs=1e-6)
    assert places.max(axis=0) == pytest.approx([1.0, 1.0, 0.5], abs=1e-6)


@pytest.mark.parametrize("suffixes", ["png", "svg,pdf"])
def test_formats_of_pictures(suffixes, tmp_path):
    with pictures.drawing(pictures.Drawing("mine", picture_formats(suffixes))):
        plots.surfaces(tmp_path / "a.png", [sheet_shown(9)], "damage")
    names = {f"a.{suffix}" for suffix in suffixes.split(",")}
    assert {path.name for path in tmp_path.iterdir()} == names
    assert pictures_in(tmp_path) == sorted(tmp_path / name for name in names)
    starts = {".pdf": b"%PDF", ".svg": b"<?xml", ".png": b"\x89PNG"}
    assert all(path.read_bytes().startswith(starts[path.suffix]) for path in tmp_path.iterdir())


def test_other_formats_are_refused():
    with refused(match="pictures = 'jpg': expected one of 'png', 'pdf', 'svg'"):
        picture_formats("png,jpg")
    assert (picture_formats(True), picture_formats(False)) == (("png",), ())


def test_names_say_what_they_are():
    assert field_label("u3") == "displacement along z (m)"
    assert field_label("velocity_1") == "velocity along x (m/s)"
    assert field_label("wrinkle_level") == "wrinkle level"
    assert field_label("my_field") == "my field"
    assert column_label("external") == "work of loads and supports"
    assert (column_unit("ball_force_z"), column_unit("pressure"), column_unit("mine")) == ("N", "Pa", "")


def test_a_large_sheet_looks_like_a_small_one(tmp_path, monkeypatch):
    """A bump with a hole and a ball on it, with larger triangles: few pixels differ, those of edges."""
    frame = sheet_shown(81, lift=0.3)
    x, y = frame.reference[:, :2].T
    frame.fields["damage"][:] = np.where(x > 0.5, 0.4, 0.0)
    whole = (np.hypot(x - 0.3, y - 0.3) > 0.12)[frame.triangles].all(axis=1)
    place, (vertices, faces) = np.array([0.7, 0.3, 0.35]), Sphere(0.2).outline(0.0)
    frame = replace(frame, triangles=frame.triangles[whole], bodies=[(place + vertices, faces)], balls=[(place, 0.2)])
    shown = []
    for most in (6000, 10**6):
        monkeypatch.setattr(plots, "MOST_TRIANGLES", most)
        plots.surfaces(tmp_path / "a.png", [frame], "damage", limits=(0.0, 1.0))
        shown.append(imread(tmp_path / "a.png")[..., :3])
    different = np.abs(shown[0] - shown[1]).max(axis=2) > 0.1
    coloured = (shown[1] < 0.99).any(axis=2)
    assert 0 < different.sum() < 0.05 * coloured.sum()
    frame.fields["damage"][:] = np.where(x > 0.5, 0.0, 0.4)
    plots.surfaces(tmp_path / "a.png", [frame], "damage", limits=(0.0, 1.0))
    other = imread(tmp_path / "a.png")[..., :3]
    assert (np.abs(shown[1] - other).max(axis=2) > 0.1).sum() > 0.3 * coloured.sum(), "the measure sees a change"


def test_a_vector_picture_holds_the_faces_as_pixels_and_many_lines_too(tmp_path, monkeypatch):
    """Tens of thousands of paths open slowly."""
    for most in (10**6, 100):
        monkeypatch.setattr(plots, "MOST_VECTORS", most)
        plots.surfaces(tmp_path / "a.svg", [sheet_shown(21)], "damage", limits=(0.0, 1.0))
        found = (tmp_path / "a.svg").read_text()
        # The bar of colours is an image in both.
        assert (found.count("<image"), found.count("<path") > 500) == ((2, True) if most > 100 else (3, False))


def tube_shown(radius, value, around=32, along=9, length=2.0):
    """A tube along x of a value of the damage, without its ends."""
    x, angle = np.meshgrid(np.linspace(0.0, length, along), 2.0 * np.pi * np.arange(around) / around, indexing="ij")
    points = np.stack([x, radius * np.cos(angle), radius * np.sin(angle)], axis=-1).reshape(-1, 3)
    k, j = (index.ravel() for index in np.meshgrid(np.arange(along - 1), np.arange(around), indexing="ij"))
    a, b = k * around + j, k * around + (j + 1) % around
    triangles = np.concatenate([np.stack([a, a + around, b], 1), np.stack([b, a + around, b + around], 1)])
    return Shown("", points, points, triangles, {"damage": np.full(len(points), value)})


def together(first, second):
    """Both sheets as one."""
    return replace(
        first,
        points=np.vstack([first.points, second.points]),
        reference=np.vstack([first.reference, second.reference]),
        triangles=np.vstack([first.triangles, second.triangles + len(first.points)]),
        fields={"damage": np.concatenate([first.fields["damage"], second.fields["damage"]])},
    )


def share_of(image, colour):
    """Part of the pixels of the sheet that have a colour, channels from 0 to 1."""
    painted = image[image[..., 3] > 0][:, :3].astype(float)
    return (np.abs(painted - np.round(255.0 * np.array(colour[:3]))).max(axis=1) <= 1).mean()


def test_a_needle_in_a_tube_and_a_tube_in_a_tube_are_hidden(monkeypatch):
    outer, inner = tube_shown(0.30, 0.0), tube_shown(0.29, 1.0, around=24, along=5)
    inside, outside = (colormaps["inferno_r"](value) for value in (1.0, 0.0))
    # One long triangle on each side, as outlines of needles have them.
    vertices, triangles = np.array([(0.2, -0.02, 0.0), (1.8, 0.0, 0.0), (0.2, 0.02, 0.0)]), np.array([[0, 1, 2]])

    def image(*frames):
        options = {"limits": (0.0, 1.0), "view": (20.0, -90.0)}
        return figure_of(monkeypatch, plots.surfaces, frames, "damage", **options).axes[0].images[0].get_array()

    grey = 0.6 + 0.4 * 0.77
    needle = [channel * grey for channel in plots.BODY[:3]]
    with_needle = replace(outer, bodies=[(vertices, triangles)])
    assert share_of(image(with_needle), needle) == 0.0
    front = outer.points[outer.triangles].mean(axis=1)[:, 1] > 0.0
    assert share_of(image(replace(with_needle, triangles=outer.triangles[front])), needle) > 0.01
    assert share_of(image(inner), inside) == 1.0
    nested = image(together(outer, inner))
    assert share_of(nested, inside) == 0.0 and share_of(nested, outside) == 1.0


def test_of_two_sheets_in_contact_the_one_with_a_value_is_shown(monkeypatch):
    joined, other = sheet_shown(9, damage=np.full(81, 0.5)), sheet_shown(12, damage=np.full(144, np.nan))
    colour = colormaps["inferno_r"](0.5)
    for picture in (plots.surfaces, plots.from_above):
        figure = figure_of(monkeypatch, picture, [together(joined, other)], "damage", limits=(0.0, 1.0))
        assert share_of(figure.axes[0].images[0].get_array(), colour) == 1.0
        above = replace(other, points=other.points + (0.0, 0.0, 0.1))
        figure = figure_of(monkeypatch, picture, [together(joined, above)], "damage", limits=(0.0, 1.0))
        assert share_of(figure.axes[0].images[0].get_array(), colour) < 0.7, "a sheet above it hides it"


def test_pieces_that_fly_off_set_neither_the_frame_nor_the_colours(monkeypatch):
    """One that no support holds, whatever its size; without supports one of a few points."""
    sheet, piece = sheet_shown(31), sheet_shown(3, width=0.1, height=0.1)
    far = replace(piece, points=piece.points + (5.0, 0.0, -30.0), fields={"damage": np.full(9, 40.0)})
    torn = together(sheet, far)
    half = replace(sheet, points=sheet.points + (5.0, 0.0, -30.0), fields={"damage": np.full(961, 40.0)})
    for frame in (torn, replace(together(sheet, half), held=np.array([0, 20]))):
        assert frame.framed.tolist() == list(range(961))
        for picture in (plots.surfaces, plots.from_above):
            figure = figure_of(monkeypatch, picture, [frame], "damage")
            assert (figure.axes[0].images[0].get_array()[..., 3] > 0).mean() > 0.3
            assert figure.axes[-1].get_ylim()[1] < 2.0
    # Half of the sheets fly, and nothing is held: both are shown. So is a sheet drawn out to a tip.
    assert len(together(sheet, half).framed) == 2 * 961
    tip = sheet.points.copy()
    tip[480, 2] += 0.9
    assert len(replace(sheet, points=tip).framed) == 961


@pytest.mark.parametrize(("width", "height"), [(1.0, 0.02), (0.02, 1.0)])
def test_a_thin_strip_is_wide_enough_to_see(width, height, monkeypatch):
    sheet = Sheet.rectangle(width, height, thickness=1e-3, density=1e3, points=101 if width > height else 3)
    frame = Shown("t = 1 s", sheet.positions, sheet.positions, sheet.triangles, {"damage": np.zeros(sheet.size)})
    figure = figure_of(monkeypatch, plots.from_above, [frame] * 2, "damage")
    box = figure.axes[0].get_window_extent()
    pixels = 130 / figure.dpi * np.array([box.width, box.height])
    assert pixels.min() > 70
    longest = "y" if height > width else "x"
    assert ("x drawn" if longest == "y" else "y drawn") in figure.axes[0].get_title()
    assert np.ptp(figure.axes[0].get_xlim()) < 1.2 * max(width, 0.1), "coordinates are those of the sheet"
    titles = [axes.title.get_window_extent() for axes in figure.axes[:2]]
    assert not titles[0].overlaps(titles[1])


@pytest.mark.parametrize(("width", "height"), [(1.0, 0.1), (0.1, 1.0)])
def test_strips_lie_beside_each_other_along_their_length(width, height, monkeypatch):
    figure = figure_of(monkeypatch, plots.from_above, [sheet_shown(9, 0.0, width, height)] * 4, "u3")
    boxes = [axes.get_window_extent() for axes in figure.axes[:4]]
    apart = [box.y0 if width > height else box.x0 for box in boxes]
    assert len({round(place) for place in apart}) == 4
    titles = [axes.title.get_window_extent() for axes in figure.axes[:4]]
    assert not any(one.overlaps(other) for one, other in itertools.combinations(titles, 2))


def test_what_is_cut_away_is_not_drawn(monkeypatch):
    """Half of a sheet from above, and what a ball hides of it in space."""
    frame = sheet_shown(21)
    whole, half = (
        figure_of(monkeypatch, plots.from_above, [frame], "u3", cut=cut).axes[0].images[0].get_array()[..., 3]
        for cut in (None, "x > 0.5")
    )
    assert (half > 0).sum() == pytest.approx(0.5 * (whole > 0).sum(), rel=0.02)
    ball = Sphere(0.6).outline(0.0)
    below = [replace(frame, bodies=[(ball[0] + [0.5, 0.5, 0.31], ball[1])])]
    hidden, cut = (
        figure_of(monkeypatch, plots.surfaces, below, "u3", view=(80.0, -90.0), cut=away).axes[0].images[0].get_array()
        for away in (None, "y<0.5")
    )
    grey = [(np.ptp(image[..., :3].astype(int), axis=2) < 45) & (image[..., 3] > 0) for image in (hidden, cut)]
    assert 0.4 < grey[1].sum() / grey[0].sum() < 0.6
    for wrong in ("w<1", "x=1", "x<a", "", "x<nan"):
        with refused(match=r"^cut = .*: expected (x, y or z, < or >, and )?a (finite )?number"):
            figure_of(monkeypatch, plots.from_above, [frame], "u3", cut=wrong)


@pytest.mark.parametrize("draw", [plots.from_above, plots.surfaces])
def test_a_cut_that_leaves_nothing_is_refused(monkeypatch, draw):
    """Of none of the frames; a sheet that leaves during a film is drawn until then."""
    frame = sheet_shown(5)
    for away in ("y<5", "x>-1"):
        with refused(match=rf"^cut = '{away}': it leaves nothing; expected a number between 0 and 1 m$"):
            figure_of(monkeypatch, draw, [frame], "u3", cut=away)
    gone = replace(frame, points=frame.points - [0.0, 9.0, 0.0])
    assert len(figure_of(monkeypatch, draw, [frame, gone], "u3", cut="y<0").axes) == 3


def test_strokes_follow_a_field_of_directions(monkeypatch):
    """They stand across the material lines' place, on the sheet and not beyond its hidden side."""
    along = np.tile([0.0, 1.0, 0.0], (441, 1))
    along[:20] = np.nan
    frame = sheet_shown(21, stretch_direction=along)
    ends, owners = strokes(frame, "stretch_direction")
    assert 380 < len(ends) < 441 and np.abs(np.diff(ends, axis=1)[..., [0, 2]]).max() < 1e-12
    corners = frame.points[frame.triangles[owners]]
    assert (np.linalg.norm(corners - ends.mean(axis=1)[:, None], axis=2).min(axis=1) < 1e-12).all()
    plain, drawn = (
        len(figure_of(monkeypatch, plots.from_above, [frame], "u3", along=field).axes[0].collections[0].get_segments())
        for field in (None, "stretch_direction")
    )
    assert plain != drawn > 400
