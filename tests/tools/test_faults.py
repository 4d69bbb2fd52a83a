"""A small campaign of faults: a kill, a file cut to nothing, a full disk where one can be mounted, two runs at once.

Changed bytes are in tests/core/test_damaged_files.py, lost terminals in tests/core/run/test_lost_terminals.py.
"""

import subprocess
import sys
from pathlib import Path

TOOL = Path(__file__).parents[2] / "tools" / "faults.py"


def test_no_fault_loses_a_result(tmp_path):
    page = tmp_path / "page.md"
    command = [
        sys.executable, TOOL, "--kills", "1", "--places", "1", "--sizes", "1", "--scenes", "Newton: tension",
        "--files", "restart.npz", "--faults", "kills", "truncations", "full_disks", "two_at_once",
    ]  # fmt: skip
    done = subprocess.run([*map(str, command), "--out", str(page)], capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    assert ", 0 failed" in done.stdout
    assert "| file cut short, resumed | Newton: tension | 1 | 0 |" in page.read_text()
    assert "| kill -9, then resumed | Newton: tension | 1 | 0 |" in page.read_text()
