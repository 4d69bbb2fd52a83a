"""Files with changed bytes, missing entries and wrong values: each is read, or refused in one line."""

import json
import os
import shutil
import subprocess
import sys
import time
import zipfile

import numpy as np
import pytest
from damage import TRIALS, damaged, require_one_line
from helpers import NEO, square
from small_runs import cli

from warp_pd import BondAssociated, Explicit, Fixed, InputError, RigidBall, Simulation
from warp_pd.fitting.data import read_table
from warp_pd.papers.neural import networks
from warp_pd.run import restart
from warp_pd.run.folder import read_history, run_summary
from warp_pd.shapes.svg import read_outline


def scene():
    sheet = square(7)
    ball = RigidBall(diameter=0.05, start=(0.05, 0.05, 0.03), velocity=(0.0, 0.0, -0.1))
    return Simulation(sheet, BondAssociated(NEO), Explicit(1e-3, frames=2), [Fixed(sheet.edges())], contact=ball)


OPTIONS = {"device": "cpu", "usd": False, "view": False, "pictures": False}


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    folder = tmp_path_factory.mktemp("whole")
    scene().run(out=folder, **OPTIONS)
    return folder


def test_changed_bytes_of_a_restart_file(folder, tmp_path):
    rng = np.random.default_rng(0)
    whole = (folder / "restart.npz").read_bytes()
    out = tmp_path / "out"
    shutil.copytree(folder, out)
    for _ in range(TRIALS):
        (out / "restart.npz").write_bytes(damaged(whole, rng))
        require_one_line(lambda: scene().run(out=out, resume=True, **OPTIONS))


@pytest.mark.parametrize("name", [*restart.NUMBERS, "parts", "settings", "solver", "version"])
def test_missing_and_wrong_numbers_of_a_restart_file(folder, tmp_path, name):
    with np.load(folder / "restart.npz") as stored:
        arrays = {key: stored[key] for key in stored.files}
    whole = json.loads(bytes(arrays["numbers"]))
    out = tmp_path / "out"
    shutil.copytree(folder, out)
    changed = [{key: value for key, value in whole.items() if key != name}]
    changed += [{**whole, name: value} for value in (None, "x", float("nan"), [], {}, [[1]], {"a": 1}, -1)]
    for number, numbers in enumerate(changed):
        arrays["numbers"] = np.frombuffer(json.dumps(numbers).encode(), np.uint8)
        np.savez(out / "restart.npz", **arrays)
        try:
            scene().run(out=out, resume=True, **OPTIONS)
        except InputError as error:
            assert "\n" not in str(error)
        else:
            assert number > 0, "an entry is missing"


def test_a_state_that_is_no_number_is_not_a_finished_run(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "out")
    with np.load(folder / "restart.npz") as stored:
        arrays = {key: stored[key] for key in stored.files}
    arrays["displacement"][3] = np.nan
    np.savez(tmp_path / "out" / "restart.npz", **arrays)
    with pytest.raises(InputError, match="'displacement' with numbers that are not finite"):
        scene().run(out=tmp_path / "out", resume=True, **OPTIONS)


@pytest.mark.parametrize("bomb", ["keys", "size"])
def test_a_restart_file_of_gigabytes_is_refused_at_once(folder, tmp_path, bomb):
    """Its zeros take a two-hundredth of that on the disk."""
    shutil.copytree(folder, tmp_path / "out")
    path = tmp_path / "out" / "restart.npz"
    arrays = {f"a{k}": np.zeros(1) for k in range(2000)} if bomb == "keys" else {}
    np.savez(path, numbers=np.zeros(1, np.uint8), **arrays)
    if bomb == "size":
        with zipfile.ZipFile(path, "a", zipfile.ZIP_DEFLATED, compresslevel=1) as archive:
            with archive.open("displacement.npy", "w", force_zip64=True) as zeros:
                for _ in range(100):
                    zeros.write(bytes(2**24))
    begin = time.perf_counter()
    with pytest.raises(InputError, match="expected at most 1000 of"):
        scene().run(out=tmp_path / "out", resume=True, **OPTIONS)
    assert time.perf_counter() - begin < 5.0


FRAMES = """
import sys
import numpy as np
sys.path[:0] = {path!r}
from damage import damaged, require_one_line
from warp_pd.output.vtkhdf import read_frames, read_outlines, read_series
from warp_pd.viewer.view import page
rng = np.random.default_rng(int(sys.argv[2]))
file = sys.argv[1] + "/frames.vtkhdf"
whole = open(file, "rb").read()
for _ in range(int(sys.argv[3])):
    open(file, "wb").write(damaged(whole, rng))
    require_one_line(lambda: [frame for frame in read_frames(file, range(read_series(file).frames))])
    require_one_line(lambda: read_outlines(file))
    require_one_line(lambda: page(sys.argv[1]))
"""


def test_changed_bytes_of_frames(folder, tmp_path):
    """In a process of its own: HDF5 may crash."""
    shutil.copytree(folder, tmp_path / "out")
    code = FRAMES.format(path=[*sys.path, os.path.dirname(__file__)])
    command = [sys.executable, "-c", code, tmp_path / "out", "0", str(4 * TRIALS)]
    done = subprocess.run([str(text) for text in command], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr[-2000:]


@pytest.mark.parametrize("name", ["summary.json", "history.csv"])
def test_changed_bytes_of_tables_and_summaries(folder, tmp_path, name):
    rng = np.random.default_rng(1)
    shutil.copytree(folder, tmp_path / "out")
    whole = (folder / name).read_bytes()
    for _ in range(4 * TRIALS):
        (tmp_path / "out" / name).write_bytes(damaged(whole, rng))
        require_one_line(lambda: (run_summary(tmp_path / "out"), read_history(tmp_path / "out" / "history.csv")))
        for command in ("info", "draw"):
            done = cli(command, tmp_path / "out", *(["--pictures", "jpg"] if command == "draw" else []))
            assert isinstance(done.exception, SystemExit | None), (command, done.exception)


def test_missing_and_wrong_entries_of_a_summary(folder, tmp_path):
    shutil.copytree(folder, tmp_path / "out")
    whole = json.loads((folder / "summary.json").read_text("utf-8"))
    for name in whole:
        for value in (..., None, "x", [], {}, 1, {"a": None}):
            entries = {key: entry for key, entry in whole.items() if key != name} | (
                {} if value is ... else {name: value}
            )
            (tmp_path / "out" / "summary.json").write_text(json.dumps(entries), "utf-8")
            for command in ("info", "draw"):
                done = cli(command, tmp_path / "out", *(["--pictures", "jpg"] if command == "draw" else []))
                assert isinstance(done.exception, SystemExit | None), (command, name, value)


def test_changed_bytes_of_a_network(tmp_path):
    rng = np.random.default_rng(2)
    whole = networks.DEFAULT.read_bytes()
    for _ in range(TRIALS):
        (tmp_path / "network.npz").write_bytes(damaged(whole, rng))
        require_one_line(lambda: networks.load(tmp_path / "network.npz"))


def test_changed_bytes_of_measured_data(tmp_path):
    rng = np.random.default_rng(3)
    whole = b"time [s]; load [N]\n" + b"".join(b"%g; %g\n" % (0.1 * k, k) for k in range(20))
    for _ in range(4 * TRIALS):
        (tmp_path / "data.csv").write_bytes(damaged(whole, rng))
        require_one_line(lambda: read_table(tmp_path / "data.csv"))


DRAWING = b"""<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 100 80" width="100mm" height="80mm">
<style>.a { fill: none }</style><g transform="rotate(10)">
<rect id="r" class="a" x="1" y="1" width="60" height="50"/></g>
<circle cx="30" cy="30" r="9"/><path d="M 45 25 C 50 20 55 30 50 35 L 45 35 Z"/></svg>"""


def outline(path):
    return read_outline(path, tolerance=1e-4, unit="mm")


def test_changed_bytes_of_a_drawing(tmp_path):
    rng = np.random.default_rng(4)
    for _ in range(TRIALS):
        (tmp_path / "drawing.svg").write_bytes(damaged(DRAWING, rng))
        require_one_line(lambda: outline(tmp_path / "drawing.svg"))


SVG = '<svg xmlns="http://www.w3.org/2000/svg">'


def copies(levels):
    groups = "".join(f'<g id="g{k}"><use href="#g{k + 1}"/><use href="#g{k + 1}"/></g>' for k in range(levels))
    return f'{SVG}<defs>{groups}<circle id="g{levels}" r="1"/></defs><use href="#g0"/></svg>'


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (f'{SVG}<circle cx="1" cy="1" r="1e300"/></svg>', "points: expected at most"),
        (f'{SVG}<circle cx="1" cy="1" r="1e12"/></svg>', "points: expected at most"),
        (copies(40), "with the copies by <use>: expected at most 100000"),
        (f'{SVG}<g id="a"><use href="#a"/></g></svg>', "must not hold itself"),
        (
            f'{SVG}<clipPath id="c">'
            + '<circle r="1"/>' * 1000
            + "</clipPath>"
            + '<g clip-path="url(#c)"/>' * 101
            + "</svg>",
            "more shapes that clip others",
        ),
        (f"{SVG}<style>{'a' * 10**6}</style></svg>", "style sheets of 1000000"),
        ("<svg>" + " " * 21_000_000 + "</svg>", "21 MB: expected at most 20 MB"),
    ],
)
def test_small_drawings_that_would_take_minutes_are_refused_at_once(tmp_path, text, said):
    (tmp_path / "drawing.svg").write_text(text)
    begin = time.perf_counter()
    with pytest.raises(InputError) as raised:
        outline(tmp_path / "drawing.svg")
    assert said in str(raised.value) and "\n" not in str(raised.value)
    assert time.perf_counter() - begin < 5.0
