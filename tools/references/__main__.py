"""Solve the references anew: `python tools/references`."""

import sys
from pathlib import Path

# The folder tools/, in place of this one.
sys.path[0] = str(Path(__file__).resolve().parents[1])

from study import run_tool  # noqa: E402

from references.run import main  # noqa: E402

if __name__ == "__main__":
    run_tool(main)
