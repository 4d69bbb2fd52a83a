"""The tools are scripts in tools/, which is no package: tests import them as those scripts import each other."""

import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[2] / "tools"))
