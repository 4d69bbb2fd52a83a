"""The parts of docs/write-your-own-part.md, taken from the page."""

import importlib.util
import re
import sys
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "write-your-own-part.md"
BLOCK = re.compile(r'^```python title="(\w+)\.py"\n(.*?)^```$', re.DOTALL | re.MULTILINE)


def sources():
    """Text of every file on the page, by the module's name."""
    return dict(BLOCK.findall(PAGE.read_text()))


def load(name, folder):
    """The module of that name, written into a folder and imported from there as a user would."""
    path = folder / f"{name}.py"
    path.write_text(sources()[name])
    spec = importlib.util.spec_from_file_location(name, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[name] = module
    spec.loader.exec_module(module)
    return module
