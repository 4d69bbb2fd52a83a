"""Run the study: `python tools/error_vs_time`."""

import sys
from pathlib import Path

# The folder tools/, in place of this one.
sys.path[0] = str(Path(__file__).resolve().parents[1])

from study import run_tool  # noqa: E402

from error_vs_time.cli import main  # noqa: E402

if __name__ == "__main__":
    run_tool(main)
