"""A run that is watched in a browser: frames and curves, pause, stop with a restart file; without the token nothing."""

import http.client
import json
import re
import subprocess
import sys
import time
from urllib.parse import urlsplit

import numpy as np
import pytest
from helpers import square
from small_runs import cli, simulate

from warp_pd import BodyPath, Explicit, Fixed, Motion, RigidBody, Sphere
from warp_pd.viewer.live import LiveRun

SCENE = """
from warp_pd import *

def build():
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=9)
    pull = Motion(sheet.edges("right"), [0.0, 1e3], x=[0.0, 5.0])
    law = BondAssociated(NeoHookean(1e3, 1e5), weights="plain")
    return Simulation(sheet, law, Explicit(1e3, frames=100000), [Fixed(sheet.edges("left")), pull])
"""


@pytest.fixture
def live():
    found = LiveRun(quiet=True)
    yield found
    found.end()


def ask(live, path, method="GET", **headers):
    connection = http.client.HTTPConnection(urlsplit(live.address).netloc, timeout=10)
    connection.request(method, path, headers=headers)
    answer = connection.getresponse()
    return answer.status, answer.read()


def test_a_watched_run_gives_its_frames_and_rows(live):
    sheet = square(9)
    ball = RigidBody(Sphere(0.02), BodyPath.still((0.05, 0.05, 0.5)), name="ball")
    loads = [Fixed(sheet.edges("left")), Motion(sheet.edges("right"), [0.0, 0.1], x=[0.0, 0.01])]
    simulation = simulate(sheet, Explicit(0.1, frames=3), loads=loads, contact=ball)
    result = simulation.run(device="cpu", reporter=live, writers=[live])
    root = urlsplit(live.address).path
    state = json.loads(ask(live, f"{root}state?from=1")[1])
    assert (state["frame"], len(state["rows"]), state["status"][:4]) == (3, 3, "over")
    assert state["fields"] == ["displacement", "strain_energy_density"]
    status, body = ask(live, f"{root}frame?field=displacement")
    n, m = np.frombuffer(body, "<i4", 2)
    reals, corners = np.frombuffer(body, "<f4", 4 * n, 8), np.frombuffer(body, "<i4", 3 * m, 8 + 16 * n)
    assert status == 200 and n > 81 and m > 128 and corners.max() == n - 1
    places, values = reals[: 3 * n].reshape(-1, 3), reals[3 * n :]
    assert places[:81] == pytest.approx(sheet.positions + result.frame.displacement, abs=1e-6)
    assert values[:81] == pytest.approx(np.linalg.norm(result.frame.displacement, axis=1), abs=1e-6)
    assert np.isnan(values[81:]).all()
    assert ask(live, f"{root}stop", "POST")[0] == 200, "a run that is over is not interrupted"


def test_requests_without_the_token_or_from_elsewhere_are_refused(live):
    root = urlsplit(live.address).path
    other = "y" if root[-2] == "x" else "x"
    for path in (
        "/",
        "/state",
        "/wrong/state",
        f"{root[:-2]}{other}/state",
        root.upper() + "state",
        "//",
        f"{root}../secret",
    ):
        assert ask(live, path)[0] == 403, path
        assert ask(live, path, "POST")[0] == 403, path
    assert ask(live, f"{root}state", Host="attacker.example")[0] == 403
    assert ask(live, f"{root}pause")[0] == 403 and ask(live, f"{root}state", "POST")[0] == 403
    assert ask(live, f"{root}frame")[0] == 403, "no frame yet"
    assert ask(live, f"{root}state?from=-1&from=x")[0] == 200
    assert live.address.startswith("http://127.0.0.1:")


def test_nothing_of_it_is_loaded_without_the_flag():
    code = (
        "import sys, warp_pd.__main__, warp_pd.viewer; print({'http.server', 'warp_pd.viewer.live'} & set(sys.modules))"
    )
    assert subprocess.check_output([sys.executable, "-c", code], text=True).strip() == "set()"
    assert (
        cli("run", "stretch", "--live", "--processes", "2").output == "warp-pd: --live: expected one process, got 2\n"
    )


def wait(page, condition, seconds=20.0):
    """Until a condition holds on the page, whose policy forbids the waiting of Playwright."""
    end = time.monotonic() + seconds
    while not page.evaluate(condition):
        assert time.monotonic() < end, (condition, page.evaluate("[state, drawn, over]"))
        time.sleep(0.05)


def test_a_run_is_watched_paused_and_stopped_in_a_browser(browser, tmp_path):
    (tmp_path / "mine.py").write_text(SCENE)
    command = [
        sys.executable,
        "-m",
        "warp_pd",
        "run",
        "mine.py",
        "--live",
        "--device",
        "cpu",
        "--out",
        "out",
        "--quiet",
    ]
    with subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True) as process:
        try:
            address = re.fullmatch(r"live: (http://127\.0\.0\.1:\d+/\S+/)\n", process.stderr.readline()).group(1)
            page = browser.new_page()
            wrong = []
            page.on("console", lambda message: wrong.append(message.text) if message.type == "error" else None)
            page.on("pageerror", lambda error: wrong.append(str(error)))
            page.goto(address)
            wait(page, "state.frame > 2 && rows.length > 2 && !!drawn")
            pixels = "c => new Set(at(c).getContext('2d').getImageData(0, 0, 800, 200).data).size"
            assert page.evaluate(pixels, "sheet") > 10 and page.evaluate(pixels, "plot") > 3
            page.click("#pause")
            wait(page, "state.status === 'paused'")
            before = page.evaluate("state.frame")
            time.sleep(1.0)
            assert page.evaluate("state.frame") == before
            page.click("#pause")
            wait(page, f"state.frame > {before}")
            page.click("#pause")
            wait(page, "state.status === 'paused'")
            assert not wrong
            page.click("#stop")
            assert process.wait(20) == 130
            wait(page, "over")
            # Nobody answers any more; how a browser says so depends on when it asks.
            assert not [text for text in wrong if "Failed to load resource: net::ERR_" not in text]
        finally:
            process.kill()
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["status"] == "interrupted"
    assert (tmp_path / "out" / "restart.npz").is_file()
