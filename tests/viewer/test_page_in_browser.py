"""The page of a run in Chromium: what it shows, and what the controls change."""

import contextlib
import csv
import json
from dataclasses import replace
from pathlib import Path

import matplotlib
import numpy as np
import pytest
from torn_frames import FRAMES, make_frame_with_fields, make_surface

from warp_pd.interfaces.frame import Body
from warp_pd.output.vtkhdf import VtkHdfSeries, read_frame
from warp_pd.viewer.view import write_page

TITLE = "tear<b>&</b>"
BOX = Body(
    "plate", "box", (0.05, 0.05, 0.01),
    np.array([[x, y, z] for x in (-0.05, 0.05) for y in (-0.05, 0.05) for z in (-0.01, 0.01)]),
    np.array([[0, 1, 3], [0, 3, 2], [4, 6, 7], [4, 7, 5], [0, 4, 5], [0, 5, 1], [2, 3, 7], [2, 7, 6], [0, 2, 6],
              [0, 6, 4], [1, 5, 7], [1, 7, 3]]),
)  # fmt: skip
MEASURES = {
    "load": {"value": 1.5, "unit": "N", "of": "last frame", "reference": 1.2, "source": "a book", "error": 0.25},
    "share": {"value": None, "unit": "1", "of": "whole run", "reference": None, "source": "", "error": None},
}


def frame_of(surface, at):
    """A tearing sheet; a plate moves along x, from the left of the sheet to its right; a field has a peak."""
    pose = np.array([[-0.2 + 0.15 * at, 0.2, 0.3, 0.0, 0.0, 0.0, 1.0]])
    frame = make_frame_with_fields(surface, at, bodies=pose)
    peak = surface.points[:, 0] + 1e3 * ((np.arange(30) == 0) & (at == 1))
    return replace(frame, point_data={**frame.point_data, "peak": peak})


def write_run(folder):
    surface = make_surface(bodies=(BOX,))
    series = VtkHdfSeries(folder / "frames.vtkhdf", surface)
    for at in range(FRAMES):
        series.write(frame_of(surface, at))
    history = [{"time": 0.01 * at, "kinetic": at**2, "load": 0.25 * at, "swing": min(at, 6 - at), "bad": np.nan}
               for at in range(FRAMES)]  # fmt: skip
    with (folder / "history.csv").open("w", newline="") as stream:
        writer = csv.DictWriter(stream, fieldnames=list(history[0]))
        writer.writeheader()
        writer.writerows(history)
    summary = {
        "scene": TITLE, "section": "", "status": "finished", "message": "", "settings": {"points": 30},
        "notes": ["a note </script><script>throw 1</script>"], "measures": MEASURES, "points": 30,
    }  # fmt: skip
    (folder / "summary.json").write_text(json.dumps(summary))


@pytest.fixture(scope="module")
def run_folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    write_run(folder)
    write_page(folder)
    return folder


@contextlib.contextmanager
def open_page(browser, folder, name="view.html", before="0"):
    """A page as a user opens it, after a script; errors in its console and requests to elsewhere fail the test."""
    opened = browser.new_page(viewport={"width": 800, "height": 600})
    opened.add_init_script(before)
    wrong = []
    opened.on("console", lambda message: message.type in ("error", "warning") and wrong.append(message.text))
    opened.on("pageerror", lambda error: wrong.append(str(error)))
    opened.on("request", lambda request: request.url.startswith("http") and wrong.append(request.url))
    opened.goto((folder / name).as_uri())
    opened.wait_for_selector("body[data-ready]", state="attached", timeout=20_000)
    yield opened
    opened.close()
    assert wrong == []


@pytest.fixture
def page(browser, run_folder):
    with open_page(browser, run_folder) as opened:
        yield opened


def to_frame(page, frame):
    page.locator("#frame").fill(str(frame))
    page.wait_for_selector(f"body[data-frame='{frame}']", state="attached")


def pick(page, label):
    page.locator("#field").select_option(label=label)
    page.wait_for_selector(f"body[data-field='{label.split(' (')[0]}']", state="attached")


def pixel(page, place):
    """Colour at a place [m] of the picture: red, green, blue, opacity."""
    return page.evaluate(
        """(place) => {
          const { view } = window.page.state, canvas = view.canvas, gl = view.renderer.getContext();
          const at = new window.vendor.Vector3(...place).project(view.camera), bytes = new Uint8Array(4);
          const x = (at.x + 1) / 2 * canvas.width, y = (at.y + 1) / 2 * canvas.height;
          gl.readPixels(x, y, 1, 1, gl.RGBA, gl.UNSIGNED_BYTE, bytes);
          return [...bytes];
        }""",
        list(place),
    )


def plainly(page, view="top"):
    """Nothing before the sheet, and no lines on it."""
    page.locator("#views button", has_text=view).click()
    page.locator("#grid").uncheck()
    page.locator("#bodies").uncheck()


def test_it_opens_with_everything_of_the_run(page):
    assert page.locator("#title").inner_text() == TITLE
    assert page.locator("#when").inner_text() == "t = 0 s"
    assert "throw 1" in page.locator("#notes p").inner_text()
    cells = page.locator("#measures tbody tr").nth(0).locator("td").all_inner_texts()
    assert [cell.split("\n")[0] for cell in cells] == ["load", "1.5 N", "1.2 N", "25 %"]
    assert "a book" in cells[0]
    assert page.locator("#measures tbody tr").nth(1).locator("td").nth(1).inner_text() == "none"


def test_the_slider_moves_time_and_torn_faces_are_gone(page, run_folder):
    plainly(page)
    middle = (0.05, 0.2, 0.0)
    opacity, pictures = [], []
    for frame in range(FRAMES):
        to_frame(page, frame)
        _, _, triangles, _ = read_frame(run_folder / "frames.vtkhdf", frame)
        assert int(page.locator("body").get_attribute("data-triangles")) == len(triangles)
        opacity.append(pixel(page, middle)[3])
        if frame in (0, FRAMES - 1):
            pictures.append(page.locator("#canvas").screenshot())
    # The first column of the middle row tears in frame 2.
    assert opacity == [255, 255, 0, 0, 0, 0, 0]
    assert pictures[0] != pictures[1]
    assert page.locator("#when").inner_text() == "t = 0.06 s"


def test_colours_are_those_of_the_bar(page):
    """Undamaged points have the colour of zero, others that of their number, seen from above and at a slant."""
    colours = matplotlib.colormaps["inferno_r"]
    for view in ("3D", "top"):
        plainly(page, view)
        to_frame(page, 1)
        # Frame 1: damage 2/7 - 4 x, clipped; the sheet hangs by 0.02 sin sin.
        for x, y in ((0.25, 0.15), (0.45, 0.3), (0.04, 0.03)):
            depth = page.evaluate(
                "([x, y]) => -0.02 * Math.sin(Math.PI * x / 0.5) * Math.sin(Math.PI * y / 0.4)", [x, y]
            )
            columns = np.clip(2.0 / 7.0 - 4.0 * np.arange(6) * 0.1, 0.0, 1.0)
            value = np.interp(x, np.arange(6) * 0.1, columns)
            expected = colours(round(255 * value), bytes=True)
            assert np.abs(np.subtract(pixel(page, (x, y, 0.98 * depth)), expected)).max() <= (0 if x > 0.1 else 6)


def test_another_field_changes_picture_bar_and_limits(page):
    plainly(page)
    to_frame(page, 5)
    before = page.locator("#canvas").screenshot()
    pick(page, "velocity (m/s)")
    assert page.locator("#bar-title").inner_text() == "velocity (m/s)"
    assert float(page.locator("#high").input_value()) == pytest.approx(0.6 * np.sqrt(3.0), rel=1e-3)
    assert page.locator("#canvas").screenshot() != before
    # All points have the same velocity, at frame 5 of 6: the colour of 5/6.
    expected = matplotlib.colormaps["viridis"](5.0 / 6.0, bytes=True)
    assert np.abs(np.subtract(pixel(page, (0.35, 0.37, 0.0)), expected)).max() <= 2


def test_limits_are_those_of_what_is_drawn(page, run_folder):
    """Loose points fly anywhere; they are not drawn, and do not count."""
    deepest = 0.0
    for frame in range(FRAMES):
        _, _, triangles, fields = read_frame(run_folder / "frames.vtkhdf", frame)
        deepest = min(deepest, fields["displacement"][np.unique(triangles), 2].min())
    pick(page, "displacement along z (m)")
    assert page.locator("#map").input_value() == "viridis"
    assert float(page.locator("#low").input_value()) == pytest.approx(deepest, rel=1e-3)
    assert float(page.locator("#high").input_value()) == 0.0


def test_a_signed_field_has_zero_in_the_middle(page):
    """The field "bonds" is the number of the point less that of the frame."""
    plainly(page)
    pick(page, "bonds")
    assert (page.locator("#low").input_value(), page.locator("#high").input_value()) == ("-29", "29")
    for frame, number in ((0, 8), (4, 22)):
        to_frame(page, frame)
        place = (0.1 * (number % 6), 0.1 * (number // 6), 0.0)
        expected = matplotlib.colormaps["coolwarm"](round(255 * (number - frame + 29) / 58), bytes=True)
        assert np.abs(np.subtract(pixel(page, place), expected)).max() <= 4


def test_peaks_can_be_left_out_of_the_limits(page):
    """The field "peak" is x, 0 to 0.5 m, but 1e3 at a point of one frame."""
    pick(page, "peak")
    assert page.locator("#high").input_value() == "1000"
    page.locator("#range").select_option("most")
    found = [float(page.locator(name).input_value()) for name in ("#low", "#high")]
    assert found == pytest.approx([0.0, 0.5], rel=1e-2)


def test_limits_of_the_colours_can_be_given(page):
    plainly(page)
    to_frame(page, 1)
    page.locator("#low").fill("nonsense")
    page.locator("#low").press("Enter")
    assert "wrong" in page.locator("#low").get_attribute("class")
    page.locator("#low").fill("-1")
    page.locator("#low").press("Enter")
    expected = matplotlib.colormaps["inferno_r"](0.5, bytes=True)
    assert np.abs(np.subtract(pixel(page, (0.45, 0.3, 0.0)), expected)).max() <= 2


def test_bodies_move_and_can_be_hidden(page):
    page.locator("#views button", has_text="top").click()
    for frame in (0, FRAMES - 1):
        to_frame(page, frame)
        seen = [pixel(page, (-0.2 + 0.15 * at, 0.2, 0.3))[3] > 0 for at in (0, FRAMES - 1)]
        assert seen == [frame == 0, frame == FRAMES - 1]
    page.locator("#bodies").uncheck()
    assert pixel(page, (-0.2 + 0.15 * (FRAMES - 1), 0.2, 0.3))[3] == 0


def test_curves_follow_the_time_and_lead_to_it(page):
    to_frame(page, 4)
    legend = page.locator(".graph").nth(0).locator(".u-legend").inner_text()
    assert "load" in legend and "1" in legend.split()[-1]
    assert "16" in page.locator(".graph").nth(1).locator(".u-legend").inner_text()
    over = page.locator(".graph").nth(0).locator(".u-over")
    box = over.bounding_box()
    over.click(position={"x": 0.5 * box["width"], "y": 20})
    page.wait_for_selector("body[data-frame='3']", state="attached")
    page.locator(".graph select").nth(0).select_option(label="bad")


def test_curves_are_drawn_against_another_column(page):
    """A column that goes up and down again: 0, 1, 2, 3, 2, 1, 0 at the loads 0, 0.25, ..., 1.5."""
    graph = page.locator(".graph").nth(0)
    against = graph.get_by_label("Column along the horizontal axis")
    options = against.locator("option").all_inner_texts()
    assert options == ["against time", "against kinetic", "against load", "against swing", "against bad"]
    against.select_option("swing")
    to_frame(page, 5)
    assert "".join(graph.locator(".u-legend").inner_text().split()) == "swing1load1.25"
    over = graph.locator(".u-over")
    place = page.evaluate(
        """() => {
          const { plot } = window.page.state.graphs[0];
          return [1, 0.25].map((n, k) => plot.valToPos(n, "xy"[k]));
        }"""
    )
    over.click(position=dict(zip("xy", place, strict=True)))
    page.wait_for_selector("body[data-frame='1']", state="attached")
    against.select_option("bad")
    against.select_option("time")
    to_frame(page, 2)
    assert "".join(graph.locator(".u-legend").inner_text().split()) == "time(s)0.02load0.5"


def test_the_view_fits_what_a_frame_shows(page):
    """In the last frame five of six columns of triangles have lost their middle; in the first the sheet is whole."""

    def half():
        return page.evaluate("() => window.page.state.view.half")

    page.locator("#views button", has_text="side").click()
    to_frame(page, 0)
    whole = half()
    page.locator("#views button", has_text="fit").click()
    # Flat at first; the run goes down by 0.12 m, and the ball begins above.
    assert half()[1] < 0.01 * whole[1] and half()[0] == pytest.approx(0.2, rel=1e-3)
    page.locator("#views button", has_text="side").click()
    assert half() == pytest.approx(whole)


def test_it_plays_to_the_end(page):
    page.locator("#speed").select_option("4")
    page.locator("#run").click()
    page.wait_for_selector(f"body[data-frame='{FRAMES - 1}']", state="attached", timeout=10_000)
    page.wait_for_function("window.page.state.playing === null")


def test_turning_zooming_and_exaggerating_change_the_picture(page):
    to_frame(page, 3)
    pictures = [page.locator("#canvas").screenshot()]
    box = page.locator("#canvas").bounding_box()
    page.mouse.move(box["x"] + 300, box["y"] + 200)
    page.mouse.down()
    page.mouse.move(box["x"] + 400, box["y"] + 230)
    page.mouse.up()
    pictures.append(page.locator("#canvas").screenshot())
    page.mouse.wheel(0, -400)
    pictures.append(page.locator("#canvas").screenshot())
    page.locator("#grow").fill("3")
    page.locator("#grow").press("Enter")
    pictures.append(page.locator("#canvas").screenshot())
    with page.expect_download() as saved:
        page.locator("#save").click()
    pictures.append(saved.value.path().read_bytes())
    assert len(set(pictures)) == 5 and pictures[-1][:4] == b"\x89PNG"


def test_a_row_of_points_is_drawn_as_points(browser, tmp_path):
    surface = make_surface(faces=np.zeros((0, 3), np.int32))
    series = VtkHdfSeries(tmp_path / "frames.vtkhdf", surface)
    series.write(make_frame_with_fields(surface, 1, index=0, intact_faces=np.zeros(0, bool)))
    write_page(tmp_path)
    # As in browsers that do not have this function yet.
    with open_page(browser, tmp_path, before="delete Uint8Array.fromBase64") as page:
        plainly(page)
        # Damage of 2/7 at x = 0.
        expected = matplotlib.colormaps["inferno_r"](2.0 / 7.0, bytes=True)
        assert np.abs(np.subtract(pixel(page, (0.0, 0.1, 0.0)), expected)).max() <= 1
        assert pixel(page, (0.05, 0.1, 0.0))[3] == 0


def test_a_page_of_the_gallery_opens(browser):
    with open_page(browser, Path(__file__).parents[2] / "docs" / "gallery", "needle.html") as page:
        assert page.locator("#title").inner_text() == "needle"


def test_without_webgl_the_numbers_are_there(browser, run_folder):
    page = browser.new_page()
    page.add_init_script("HTMLCanvasElement.prototype.getContext = new Proxy("
                         "HTMLCanvasElement.prototype.getContext, { apply: (get, canvas, [kind]) => "
                         "kind === '2d' ? get.call(canvas, kind) : null })")  # fmt: skip
    page.goto((run_folder / "view.html").as_uri())
    page.wait_for_selector("#trouble:not([hidden])")
    assert "The sheet cannot be drawn" in page.locator("#trouble").inner_text()
    assert page.locator("#measures tbody tr").count() == 2 and page.locator(".u-over").count() == 2
    page.locator(".u-over").first.click()
    page.close()


def test_pieces_are_displaced_from_where_they_were_placed(browser, tmp_path):
    surface = replace(make_surface(), metadata={**make_surface().metadata, "pieces": 2})
    series = VtkHdfSeries(tmp_path / "frames.vtkhdf", surface)
    for at in range(3):
        frame = make_frame_with_fields(surface, at)
        moved = np.zeros_like(frame.displacement) + [5.0 + 0.5 * at, 0.0, 0.0]
        series.write(replace(frame, displacement=moved))
    write_page(tmp_path)
    with open_page(browser, tmp_path) as page:
        for label in ("displacement along x", "displacement"):
            labels = page.locator("#field option").all_inner_texts()
            page.locator("#field").select_option(label=next(x for x in labels if x.split(" (")[0] == label))
            page.wait_for_selector(f"body[data-field='{label}']", state="attached")
            assert [float(page.locator(f"#{end}").input_value()) for end in ("low", "high")] == pytest.approx(
                [0.0, 1.0], abs=1e-3
            )
