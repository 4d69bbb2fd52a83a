"""SIGTERM and Ctrl-C end a run within two seconds wherever it is, with a summary."""

import json
import re
import signal
import subprocess
import sys
import time

import pytest

SCENE = '''
"""A run that hangs: its measure waits in a call that Python cannot interrupt."""
import time
from warp_pd import BondAssociated, Explicit, Fixed, Measure, NeoHookean, Sheet, Simulation

def hang(built, frame):
    if frame.index == 2:
        open("hangs", "w").close()
        end = time.monotonic() + 60.0
        while time.monotonic() < end:
            time.sleep(60.0)
    return 0.0

def build():
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=7)
    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5)), Explicit(1e-3, frames=4), [Fixed(sheet.edges())],
                      measures=[Measure("hang", "1", hang)])
'''


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT, signal.SIGHUP])
def test_a_run_that_hangs_ends_with_its_summary(number, tmp_path):
    (tmp_path / "hang.py").write_text(SCENE)
    command = [sys.executable, "-m", "warp_pd.__main__", "run", "hang.py", "--device", "cpu", "--out", "out"]
    running = subprocess.Popen(command, cwd=tmp_path, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "hangs").exists():
        assert running.poll() is None
        time.sleep(0.05)
    begin = time.monotonic()
    running.send_signal(number)
    _, errors = running.communicate(timeout=60)
    # Of the 60 s; two on an idle machine.
    assert time.monotonic() - begin < 10.0
    assert running.returncode == 128 + number and "warp-pd: interrupted: continue with --resume" in errors
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["status"] == "interrupted"
    said = summary["notes"][-1]
    assert re.search("`warp-pd draw .*` draws, `warp-pd view .*` writes the page, and .* --resume .* writes all$", said)
