"""view.html of a run: when it is written, what it holds, and what is refused."""

import base64
import json
import os
import re
import shutil
import zlib

import matplotlib
import numpy as np
import pytest
from helpers import refused, square
from small_runs import cli, simulate
from torn_frames import FRAMES, make_frame, write_all

from warp_pd.output.quantities import choices, column_unit, curves, known_units
from warp_pd.output.vtkhdf import VtkHdfSeries
from warp_pd.viewer import after_run
from warp_pd.viewer.view import Limits, files, page, page_frames, write_page


def content_of(text):
    return json.loads(re.search(r'id="content">(.*?)</script>', text)[1])


def test_a_run_writes_its_page_which_needs_nothing_else(ball):
    text = (ball / "view.html").read_text(encoding="utf-8")
    assert len(text) < 3e6
    content = content_of(text)
    assert content["title"] == "ball_penetration" and len(content["frames"]) == 25
    assert content["leftOut"] == []
    assert {c["label"] for c in content["choices"]} >= {"damage", "displacement along z", "strain energy density"}
    assert content["summary"]["measures"]["tear_begins"]["unit"] == "s"
    assert [body["name"] for body in content["bodies"]] == ["ball"]
    assert not re.search(r"<(script|link|img)[^>]*(src|href)=", text)
    assert "import(" not in text and "fetch(" not in text.split('id="content"')[0]


def test_the_same_run_gives_the_same_page(ball):
    assert page(ball) == page(ball)


def test_a_run_can_leave_it_out(tmp_path):
    simulate(square(7)).run(device="cpu", out=tmp_path)
    assert not (tmp_path / "view.html").exists()


def test_a_large_sheet_gets_a_note_in_place_of_its_page(tmp_path, monkeypatch):
    # A sheet that is large takes minutes.
    monkeypatch.setattr(after_run, "LARGE", 48)
    result = simulate(square(7)).run(device="cpu", out=tmp_path, view=True)
    assert not (tmp_path / "view.html").exists()
    assert (
        f"view.html: not written because of the number of points; write it with `warp-pd view {tmp_path}`"
        in result.summary["notes"]
    )
    done = cli("view", tmp_path)
    assert done.exit_code == 0 and (tmp_path / "view.html").is_file()


def test_what_a_page_leaves_out_it_says(ball):
    content = content_of(page(ball, Limits(100, 5)))
    assert len(content["frames"]) == 5
    assert content["frames"][-1]["when"] == "t = 4 s"
    assert re.fullmatch(r"\d+ of 441 points are drawn; .*", content["leftOut"][0])
    assert content["leftOut"][1] == "5 of 25 frames are shown"


def test_a_page_holds_so_many_numbers_and_some_frames_in_any_case():
    limits = Limits()
    assert list(limits.chosen_frames(10, 8 * 40_000)) == list(range(10))
    assert len(limits.chosen_frames(1000, 8 * 40_000)) == 37
    found = limits.chosen_frames(1000, 20 * 40_000)
    assert len(found) == 16 and found[0] == 0 and found[-1] == 999
    # The worst case, in bytes of text: numbers that do not compress.
    assert 16 * 20 * 1.06 * 40_000 * 2 * 4 / 3 < 50e6


def test_a_killed_run_has_a_page_without_curves(tmp_path):
    write_all(VtkHdfSeries, tmp_path / "frames.vtkhdf", last=3, frame=make_frame)
    content = content_of(write_page(tmp_path).read_text(encoding="utf-8"))
    assert len(content["frames"]) == 3 and content["history"]["graphs"] == [] and content["summary"] == {}


def test_pieces_that_fly_away_do_not_set_the_first_view(tmp_path):
    """The right columns come off and fly up; a view of them would show the sheet as a speck."""

    def burst(surface, at):
        x = surface.points[:, 0]
        up = np.where(x > 0.25, 2.0 * max(at - 1, 0), 0.01 * at * x)
        across = np.ptp(1 * (x[surface.faces] > 0.25), axis=1) > 0
        return make_frame(surface, at, displacement=np.outer(up, (0.0, 0.0, 1.0)), intact_faces=~across | (at <= 1))

    surface = write_all(VtkHdfSeries, tmp_path / "frames.vtkhdf", frame=burst)
    found = page_frames(tmp_path / "frames.vtkhdf")
    framing = found.content["framing"]
    packed = zlib.decompress(base64.b64decode(found.arrays.texts[framing["points"]["text"]]))
    seen = np.unpackbits(np.frombuffer(packed, np.uint8).reshape(len(framing["frames"]), -1), axis=1, bitorder="little")
    stays = surface.points[:, 0] < 0.25
    assert framing["frames"][0] == 0 and framing["frames"][-1] == FRAMES - 1
    for frame, points in zip(framing["frames"], seen[:, : len(stays)].astype(bool), strict=True):
        assert points.tolist() == (stays if frame > 1 else stays | True).tolist()


def test_nan_and_markup_of_a_run_do_no_harm(tmp_path):
    write_all(VtkHdfSeries, tmp_path / "frames.vtkhdf")
    summary = {"scene": "</script><b>", "settings": {}, "status": "finished", "measures": {}, "residual": float("inf")}
    (tmp_path / "summary.json").write_text(json.dumps(summary))
    (tmp_path / "history.csv").write_text("time,load\n" + "\n".join(f"{k},nan" for k in range(FRAMES)))
    text = page(tmp_path)
    assert text.count("</script><b>") == 0
    content = content_of(text)
    assert content["title"] == "</script><b>" and content["summary"]["residual"] is None
    assert content["history"]["columns"]["load"] == [None] * FRAMES


def missing(folder):
    return folder / "nowhere", "does not exist"


def a_file(folder):
    return folder / "summary.json", "it is a file"


def no_frames(folder):
    (folder / "frames.vtkhdf").unlink()
    return folder, "it has no frames.vtkhdf"


def damaged(folder):
    (folder / "frames.vtkhdf").write_bytes(b"nothing")
    return folder, "expected a complete VTKHDF file of frames"


@pytest.mark.parametrize("wrong", [missing, a_file, no_frames, damaged])
def test_a_folder_that_is_none_of_a_run_is_refused_in_one_line(wrong, ball, tmp_path):
    shutil.copytree(ball, tmp_path / "run")
    folder, expected = wrong(tmp_path / "run")
    done = cli("view", folder)
    assert done.exit_code == 2 and expected in done.output and len(done.output.strip().splitlines()) == 1


@pytest.mark.parametrize(
    "options", [("--points", "1"), ("--frames", "0"), ("--out", "/dev/null/x.html"), ("--out", ".")]
)
def test_options_that_cannot_be_are_refused_in_one_line(options, ball):
    done = cli("view", ball, *options)
    assert done.exit_code == 2 and options[0].strip("-") in done.output and len(done.output.strip().splitlines()) == 1


@pytest.mark.skipif(os.name != "posix", reason="limits the size of files as POSIX does")
def test_a_page_that_cannot_be_written_leaves_the_old_one(ball, tmp_path):
    import resource

    out = tmp_path / "view.html"
    out.write_text("old")
    limits = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (10_000, limits[1]))
    try:
        with refused(match="File too large"):
            write_page(ball, out)
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, limits)
    assert out.read_text() == "old" and list(tmp_path.iterdir()) == [out]


def test_names_get_words_and_units():
    measures = known_units({"measures": {"load": {"unit": "N"}, "share": {"unit": "1"}}, "units": {"pull_x": "N"}})
    columns = [
        "time",
        "step",
        "half_step_kinetic",
        "kinetic",
        "strain",
        "ball_force_x",
        "ball_force_y",
        "ball_force_z",
        "load",
        "pressure",
    ]
    columns += ["pull_x"]
    graphs = curves(columns, ["load"], measures)
    assert [(g["label"], g["unit"], len(g["columns"])) for g in graphs] == [
        ("load", "N", 1), ("ball force", "N", 3), ("energies", "J", 2), ("pressure", "Pa", 1),
        ("pull x", "N", 1),
    ]  # fmt: skip
    assert (column_unit("share", measures), column_unit("lid_torque_y", {}), column_unit("unknown", {})) == (
        "", "N m", "",
    )  # fmt: skip
    assert next(c.label for c in choices("principal_stress", 3)) == "largest principal stress"
    assert [(c.label, c.unit) for c in choices("my_heat", 1)] == [("my heat", "")]


def test_colours_are_those_of_matplotlib():
    text = (files("warp_pd.viewer") / "page" / "colours.js").read_text()
    for name, stored in re.findall(r'(\w+): "([0-9a-f]{1536})"', text):
        colours = bytes(matplotlib.colormaps[name](range(256), bytes=True)[:, :3].tobytes())
        assert stored == colours.hex()


def test_fields_can_be_chosen(ball):
    content = content_of(page(ball, Limits(fields=["damage"])))
    assert sorted(content["fields"]) == ["damage", "displacement"]
    with refused(match=r"fields = 'damge'.*damage"):
        page(ball, Limits(fields=["damge"]))


def test_a_page_has_the_notices_of_what_it_contains(tmp_path):
    """The MIT licence asks for its notice in every copy."""
    write_all(VtkHdfSeries, tmp_path / "frames.vtkhdf", last=1, frame=make_frame)
    text = page(tmp_path)
    assert text.count("three.js authors") == 1 and text.count("Permission is hereby granted") == 2
    assert text.index("three.js authors") < text.index("<body>") and "Leon Sorokin" in text
    assert "--" not in text.partition("<!-- This page contains:")[2].partition("-->")[0]
