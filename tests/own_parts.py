"""The parts of docs/write-your-own-part.md, taken from the page, and the recipes of docs/recipes."""

import importlib.util
import re
import sys
from pathlib import Path

PAGE = Path(__file__).parents[1] / "docs" / "write-your-own-part.md"
RECIPES = PAGE.parent / "recipes"
BLOCK = re.compile(r'^```python title="(\w+)\.py"\n(.*?)^```$', re.DOTALL | re.MULTILINE)


def sources():
    """Text of every file on the page, by the module's name."""
    return dict(BLOCK.findall(PAGE.read_text()))


def load(name, folder):
    """The module of that name, written into a folder and imported from there as a user would."""
    path = folder / f"{name}.py"
    path.write_text(sources()[name])
    return imported(path)


def recipe(name):
    """The module of a recipe."""
    return sys.modules.get(name) or imported(RECIPES / f"{name}.py")


def imported(path):
    """The module of a file, under the file's name."""
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = module
    spec.loader.exec_module(module)
    return module
