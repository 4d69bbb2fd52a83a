"""Files are UTF-8 whatever the locale says."""

import os
import subprocess
import sys

SCENE = """
from warp_pd import *

def build(frames=2):
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=7)
    measures = [Measure("H\\u00f6he", "m", lambda built, frame: frame.displacement.max())]
    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5)), Explicit(frames * 1e-4, frames=frames),
                      measures=measures, notes=["gr\\u00f6\\u00dfer"])
"""


# All in one process, as each takes its time to begin; `main` ends it by SystemExit.
COMMANDS = """
import sys
from warp_pd.__main__ import main

run = ["run", "mine.py", "--device", "cpu", "--out", "out", "--no-usd"]
for arguments in (run, ["info", "out"], ["view", "out"], ["draw", "out", "--scene", "mine.py"],
                  [*run, "--resume", "--set", "frames=4"]):
    sys.argv[1:] = arguments
    try:
        main()
    except SystemExit as ended:
        assert not ended.code, arguments
"""


def test_names_beyond_ascii_in_a_locale_without_them(tmp_path):
    """A run, its contents, its page, its pictures and a resumed run under LC_ALL=C."""
    (tmp_path / "mine.py").write_text(SCENE, "utf-8")
    plain = {**os.environ, "LC_ALL": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
    command = [sys.executable, "-X", "warn_default_encoding", "-c", COMMANDS]
    done = subprocess.run(command, cwd=tmp_path, env=plain, capture_output=True, check=False)
    assert done.returncode == 0, done.stderr
    ours = [line for line in done.stderr.splitlines() if b"EncodingWarning" in line and b"warp_pd" in line]
    assert not ours, ours
    assert len((tmp_path / "out" / "history.csv").read_text("utf-8").splitlines()) == 6
    assert "H\u00f6he" in (tmp_path / "out" / "history.csv").read_text("utf-8")
