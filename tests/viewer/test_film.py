"""A film shows every frame of a run, in one frame of reference; wrong options are one line each."""

import io
import os

import numpy as np
import pytest
from helpers import refused, square
from PIL import Image
from small_runs import cli, simulate

from warp_pd import Explicit, Fixed, Motion
from warp_pd.run.folder import run_summary
from warp_pd.viewer import film as module
from warp_pd.viewer.film import film


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    out, sheet = tmp_path_factory.mktemp("film"), square(5)
    loads = [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 0.1], x=[0.0, 0.05], z=[0.0, 0.02])]
    simulate(sheet, Explicit(0.1, frames=4), loads=loads).run(
        device="cpu", out=out, usd=False, view=False, pictures=False
    )
    return out


def test_every_frame_is_a_picture_of_one_size(folder):
    assert "film.gif: 5 pictures, 0.5 s" in cli("film", str(folder), "--rate", "10").output
    with Image.open(folder / "film.gif") as images:
        assert (images.n_frames, images.info["duration"]) == (5, 100)
    assert not list(folder.glob(".*unfinished*"))
    assert film(folder, folder / "some.webp", "velocity_1", every=2, view=(10.0, 30.0)) == 3
    assert cli("view", str(folder), "--out", str(folder / "small.html")).exit_code == 0
    assert run_summary(folder)["made"] == ["film.gif", "small.html"]


@pytest.mark.parametrize("suffix", [".gif", ".webp"])
@pytest.mark.parametrize("rate", [24.0, 30.0, 45.0, 50.0])
def test_a_film_takes_as_long_as_its_rate_says(folder, tmp_path, monkeypatch, suffix, rate):
    """To half a tick of the format: a GIF counts in hundredths of a second, of which browsers show no less than two."""
    path, tick = tmp_path / f"a{suffix}", 10 if suffix == ".gif" else 1
    monkeypatch.setattr(module, "_pictures", lambda frames, drawn: map(plain_picture, range(len(frames))))
    film(folder, path, rate=rate)
    with Image.open(path) as images:
        shown = [(images.seek(k), images.load(), images.info["duration"])[2] for k in range(images.n_frames)]
    assert abs(sum(shown) - 5e3 / rate) <= 0.5 * tick and min(shown) >= 2 * tick


def plain_picture(number):
    """PNG of one colour."""
    stream = io.BytesIO()
    Image.new("RGB", (9, 9), (50 * number, 0, 0)).save(stream, "PNG")
    return stream.getvalue()


def test_ffmpeg_gets_the_pictures_in_order(folder, tmp_path, monkeypatch):
    program = tmp_path / "ffmpeg"
    program.write_text('#!/bin/sh\nfor last; do :; done\ncat > "$last"\n')
    program.chmod(0o755)
    monkeypatch.setenv("PATH", f"{tmp_path}{os.pathsep}{os.environ['PATH']}")
    assert film(folder, tmp_path / "a.mp4") == 5
    assert (tmp_path / "a.mp4").read_bytes().count(b"\x89PNG") == 5


def test_wrong_films_are_refused(folder, tmp_path, monkeypatch):
    for options, said in (
        ({"path": tmp_path / "a.avi"}, r"^film = '\.avi': expected one of [^()]*$"),
        ({"field": "heat"}, r"^field = 'heat': expected one of 'displacement'"),
        ({"rate": 0.0}, r"^rate = 0\.0: expected a positive number$"),
        ({"rate": 60.0}, r"^rate = 60\.0: expected 0\.002 to 50 pictures a second in a \.gif$"),
        ({"rate": 1e-3}, r"^rate = 0\.001: expected 0\.002 to 50 pictures"),
        ({"rate": 2e3, "path": tmp_path / "a.webp"}, r"^rate = 2000\.0: expected 0\.0001 to 1000 pictures a second"),
    ):
        with refused(match=said):
            film(folder, **{"path": tmp_path / "a.gif", **options})
    monkeypatch.setattr(module, "MOST", 60)
    with refused(match=r"^5 frames of 25 points: expected --every 3 or more$"):
        film(folder, tmp_path / "a.gif")
    monkeypatch.setenv("PATH", str(tmp_path))
    with refused(match=r"a\.mp4': expected \.gif or \.webp, or ffmpeg on the path$"):
        film(folder, tmp_path / "a.mp4")


def test_the_bar_of_a_gif_has_no_steps(folder):
    film(folder, folder / "smooth.gif")
    with Image.open(folder / "smooth.gif") as images:
        pixels = np.asarray(images.convert("RGB")).astype(int)
    column = pixels[:, np.flatnonzero((np.ptp(pixels, axis=2) > 20).mean(axis=0) > 0.5)[-1]]
    bar = column[np.ptp(column, axis=1) > 20]
    assert len(bar) > 100 and np.abs(np.diff(bar, axis=0)).max() <= 8
