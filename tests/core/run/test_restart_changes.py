"""Changes between a run and its resumption, of what is no part of the state: refused in one line, or done right."""

import shutil
import sys
from functools import partial
from types import SimpleNamespace

import numpy as np
import pytest
from helpers import NEO, StopAt, square
from point_laws import tiny
from small_runs import cli

from warp_pd import BondAssociated, Explicit, Fixed, InputError, Measure, Neural, Pressure, Simulation
from warp_pd.run.folder import read_history


def simulation(**changes):
    sheet = square(7)
    given = {"force": BondAssociated(NEO), "solver": Explicit(1e-3, frames=4), **changes}
    return Simulation(sheet, loads=[Fixed(sheet.edges()), Pressure(2.0)], **given)


def stopped_and_resumed(folder, began, goes_on, **changed):
    """The result of a resumed run, or None if it was refused in one line."""
    options = {"out": folder, "device": "cpu", "usd": False}
    assert began.run(**options, writers=[StopAt(3)]).status == "interrupted"
    try:
        return goes_on.run(**{**options, **changed}, resume=True)
    except InputError as refused:
        assert "\n" not in str(refused)
        return None


def measure(name):
    return Measure(name, "m", lambda built, frame: float(frame.displacement[:, 2].max()))


CHANGED = {"added": ([], ["a"]), "removed": (["a"], []), "renamed": (["a"], ["b"]), "one more": (["a"], ["a", "b"])}


@pytest.mark.parametrize("change", CHANGED)
def test_other_measures_leave_a_history_with_every_number(change, tmp_path):
    began, goes_on = (simulation(measures=[measure(name) for name in names]) for names in CHANGED[change])
    result = stopped_and_resumed(tmp_path, began, goes_on)
    history = read_history(tmp_path / "history.csv")
    if result is not None:
        assert result.status == "finished" and len(history) == 5
        assert all(row.keys() == history[0].keys() for row in history)
        assert {m.name for m in goes_on.measures} <= history[-1].keys()
    else:
        again = simulation(measures=began.measures).run(out=tmp_path, device="cpu", usd=False, resume=True)
        assert again.status == "finished"


def test_a_network_of_other_weights_is_refused():
    """Also a user's module, whose text has only the shapes of its layers."""
    torch = pytest.importorskip("torch")
    from warp_pd.run.restart import identity

    def layer(bias):
        made = torch.nn.Linear(4, 2)
        torch.nn.init.zeros_(made.weight)
        torch.nn.init.constant_(made.bias, bias)
        return made

    def known(network):
        scene = simulation(force=Neural(NEO, network=network))
        return identity(scene, scene.build("cpu"))

    for network in (layer, tiny):
        assert known(network(0)) == known(network(0)) != known(network(1))


SCENE = """
from dataclasses import dataclass
from pathlib import Path
from warp_pd import *
import beside

@dataclass(frozen=True)
class Own(NeoHookean):
    factor = 1.0

def build(duration=1e-3, frames=2, push=2.0):
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=5)
    k = float(Path(__file__).with_name("k.txt").read_text())
    high = Measure("high", "m", lambda built, frame: k * beside.factor() * frame.displacement[:, 2].max())
    law = BondAssociated(Own(mu=beside.MU, bulk=1e5))
    loads = [Fixed(sheet.edges()), Pressure(push)]
    return Simulation(sheet, law, Explicit(duration, frames=frames), loads, measures=[high])
"""
BESIDE = "MU = 1e3\ndef factor(): return 1.0\n"
FURTHER = ("--set", "duration=2e-3", "--set", "frames=4")
EDITED = {
    "the measure": ("mine.py", "[:, 2].max()", "[:, 2].min()", (), "code (mine.py has changed)"),
    "the material": ("mine.py", "factor = 1.0", "factor = 2.0", (), "code (mine.py has changed)"),
    "a module beside": ("beside.py", "return 1.0", "return 2.0", (), "code (beside.py has changed)"),
    "a file": ("k.txt", "5", "7", (), "code (measures.high.k = 5.0, here 7.0)"),
    "a value": ("beside.py", "1e3", "2e3", (), "settings (force.material.mu = 1000.0, here 2000.0)"),
    "a setting": ("k.txt", "5", "5", ("--set", "push=3"), "settings (push = 2.0, here 3.0)"),
}


@pytest.fixture(scope="module")
def begun(tmp_path_factory):
    folder = tmp_path_factory.mktemp("begun")
    for name, text in {"mine.py": SCENE, "beside.py": BESIDE, "k.txt": "5"}.items():
        (folder / name).write_text(text)
    assert resumed(folder, "--quiet", goes_on=False).exit_code == 0
    return folder


def resumed(folder, *arguments, goes_on=True):
    sys.modules.pop("beside", None)
    given = ("--device", "cpu", "--no-usd", "--no-view", "--no-pictures", *(("--resume",) if goes_on else ()))
    try:
        return cli("run", folder / "mine.py", *given, "--out", folder / "out", *arguments)
    finally:
        sys.path.remove(str(folder))


@pytest.mark.parametrize("what", EDITED)
def test_a_longer_run_of_an_edited_scene_is_refused_for_what_was_edited(begun, what, tmp_path):
    """And not for its duration and frames, which may change."""
    name, old, new, settings, said = EDITED[what]
    shutil.copytree(begun, tmp_path, dirs_exist_ok=True)
    (tmp_path / name).write_text((tmp_path / name).read_text().replace(old, new))
    done = resumed(tmp_path, *FURTHER, *settings)
    assert done.exit_code == 2 and f"different {said}; expected" in done.output, done.output
    assert len(done.output.strip().splitlines()) == 1


def test_a_longer_run_of_a_scene_with_another_comment_goes_on(begun, tmp_path):
    shutil.copytree(begun, tmp_path, dirs_exist_ok=True)
    for name in ("mine.py", "beside.py"):
        (tmp_path / name).write_text("# A comment.\n" + (begun / name).read_text())
    assert resumed(tmp_path, *FURTHER).exit_code == 0
    assert len(read_history(tmp_path / "out" / "history.csv")) == 5


def scaled(factor, offset=0.0, table=(1.0,), shape=None):
    def height(built, frame, offset=offset):
        return factor * float(frame.displacement[:, 2].max()) + offset + table[0] + (shape.size if shape else 0)

    return height


def counting():
    count = 0

    def height(built, frame):
        nonlocal count
        count += 1
        return count

    return height


SHAPES = [SimpleNamespace(size=size) for size in (1.0, 2.0)]
VECTORIZED = np.vectorize(lambda built, frame: 1.0)
FUNCTIONS = {
    "itself": (scaled(1.0), scaled(1.0), True),
    "closure": (scaled(1.0), scaled(2.0), False),
    "default": (scaled(1.0), scaled(1.0, offset=1.0), False),
    "array": (scaled(1.0, table=np.ones(3)), scaled(1.0, table=np.arange(3.0)), False),
    "object": (scaled(1.0, shape=SHAPES[0]), scaled(1.0, shape=SHAPES[1]), False),
    "partial": (partial(lambda k, b, f: k, 1.0), partial(lambda k, b, f: k, 2.0), False),
    "code": (lambda b, f: 1.0, lambda b, f: 2.0, False),
    "cache": (VECTORIZED, VECTORIZED, True),
    "state": (counting(), counting(), True),
}


@pytest.mark.parametrize("what", FUNCTIONS)
def test_a_measure_of_the_same_name_that_computes_something_else_is_refused(what, tmp_path):
    first, other, same = FUNCTIONS[what]
    began, goes_on = (simulation(measures=[Measure("a", "m", value)]) for value in (first, other))
    result = stopped_and_resumed(tmp_path, began, goes_on)
    assert (result is not None) == same
