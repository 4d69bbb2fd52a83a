"""Text of the command line as arguments of a scene."""

import inspect
import json
import subprocess
import sys

import pytest
from helpers import refused
from small_runs import cli

from warp_pd.command.arguments import converted, is_plain, plain, split_values
from warp_pd.command.scene_files import build_scene, require_settings


def build(
    free, whole=3, real=1.5, text="a", truth=True, unset=None, unset_real: float | None = None, pair=(0.1, 0.2),
    path=((0.0, 1.0), (1.0, 2.0)), names=("left", "right"), unit: str | None = None,
):  # fmt: skip
    pass


PARAMETERS = inspect.signature(build).parameters


@pytest.mark.parametrize(
    ("key", "text", "expected"),
    [
        ("free", "11", 11),
        ("free", "1e-3", 1e-3),
        ("free", "uniaxial", "uniaxial"),
        ("free", "true", True),
        ("free", "none", None),
        ("free", "(0.1, 2)", (0.1, 2)),
        ("whole", "11", 11),
        ("real", "11", 11.0),
        ("text", "11", "11"),
        ("truth", "no", False),
        ("unset", "11", 11),
        ("unset", "none", None),
        ("unset", "mm", "mm"),
        ("unset_real", "11", 11.0),
        ("unit", "mm", "mm"),
        ("unit", "11", "11"),
        ("unit", "none", None),
        ("pair", "0.3,0.4", (0.3, 0.4)),
        ("pair", "(0.3, 0.4)", (0.3, 0.4)),
        ("pair", "0.3", (0.3,)),
        ("pair", [0.3, 0.4], (0.3, 0.4)),
        ("path", "(0,1),(1,3)", ((0, 1), (1, 3))),
        ("path", "((0,1),(1,3))", ((0, 1), (1, 3))),
        ("names", "top,bottom", ("top", "bottom")),
    ],
)
def test_text_becomes_what_the_argument_takes(key, text, expected):
    found = converted(key, text, PARAMETERS)
    assert found == expected and type(found) is type(expected)


@pytest.mark.parametrize(
    ("key", "text", "said"),
    [
        ("whole", "11.0", "--set whole = '11.0': expected a whole number"),
        ("real", "0.1,0.2", "--set real = '0.1,0.2': expected a number"),
        ("pair", "a,b", "--set pair = 'a,b': expected values separated by commas, such as 0.1,0.2"),
        ("pair", "__import__('os')", "expected values separated by commas, such as 0.1,0.2"),
        ("path", "0,1", "--set path = '0,1': expected values separated by commas, such as (0.0, 1.0),(1.0, 2.0)"),
        ("parir", "1", "did you mean 'pair'?"),
    ],
)
def test_what_does_not_fit_is_refused(key, text, said):
    with refused(said):
        converted(key, text, PARAMETERS)


def test_values_of_a_sweep_keep_their_brackets():
    assert split_values("1.5, 2.015,3.15") == ["1.5", "2.015", "3.15"]
    assert split_values("(0.1,0.2),(0.3,0.4)") == ["(0.1,0.2)", "(0.3,0.4)"]


def test_settings_survive_json():
    assert json.loads(json.dumps(plain((1, (2.0, "a"))))) == plain((1, (2.0, "a"))) == [1, [2.0, "a"]]
    assert not is_plain((1, build)) and is_plain(((0.0, 1.0),))


SCENE = """
from warp_pd import *

def build(points, centre=(0.5, 0.5)):
    assert type(points) is int and isinstance(centre, tuple) and len(centre) == 2
    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points)
    measures = [Measure("x", "m", lambda built, frame: centre[0])]
    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5)), Explicit(1e-4, frames=1), measures=measures)
"""


def test_a_scene_with_a_dataclass_and_postponed_annotations(tmp_path, monkeypatch):
    """Its module has a name of its own, also if the file is called like another module."""
    monkeypatch.chdir(tmp_path)
    text = SCENE.replace(
        "def build", "@dataclass\nclass Size:\n    width: float = 1.0\n    kind: ClassVar[int] = 1\n\ndef build"
    )
    head = "from __future__ import annotations\nfrom dataclasses import dataclass\nfrom typing import ClassVar\n"
    (tmp_path / "json.py").write_text(head + text.replace("rectangle(1.0,", "rectangle(Size().width,"))
    assert build_scene("json.py", {"points": 7}).sheet.size == 49
    assert sys.modules["json"] is json


def test_a_scene_with_tuples_and_without_defaults(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "mine.py").write_text(SCENE)
    done = cli("run", "mine.py", "--set", "points=7", "--set", "centre=0.25,0.5", "--no-usd", "--device", "cpu")
    assert done.exit_code == 0 and "x = 0.25 m" in done.output, done.output
    settings = json.loads((tmp_path / "runs" / "mine" / "summary.json").read_text())["settings"]
    assert settings == {"points": 7, "centre": [0.25, 0.5]}
    refused = cli("run", "mine.py")
    assert refused.exit_code == 2 and "points has no default: expected --set points=VALUE" in refused.output
    assert cli("draw", "runs/mine", "--scene", "mine.py").exit_code == 0, "from the settings of the summary"


NEVER_IMPORTED = (
    "raise RuntimeError('imported')\ndef build(points, *, length: float | None = None, pair=(1.0, 2.0)):\n    pass\n"
)


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"points": "7", "lenght": "1"}, "lenght is not an argument of this scene"),
        ({"points": "7", "length": "long"}, "--set length = 'long': expected a number"),
        ({"points": "7", "pair": "a"}, "--set pair = 'a'"),
        ({}, "points has no default: expected --set points=VALUE"),
    ],
)
def test_settings_are_checked_against_the_text_of_a_scene(settings, said, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(NEVER_IMPORTED)
    require_settings(str(path), {"points": 7, "length": "none"})
    with refused(said):
        require_settings(str(path), settings)


@pytest.mark.parametrize(
    "text",
    [
        "from other import build\n",
        "LENGTH = 2.0\ndef build(points=3, length=LENGTH): pass\n",
        "def build(**k): pass\n",
        "def build(:",
    ],
)
def test_parameters_that_the_text_does_not_tell_are_left_to_the_import(text, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(text)
    require_settings(str(path), {"whatever": "1"})


CHECKED = """raise RuntimeError("imported")
from warp_pd.device.checks import count, one_of, positive
def build(points=9, speed=1.0, length: float | None = None, grip="clamp", seed=1, late=1, own=1, least=3):
    least = max(least, 1)
    frames = count("points", points, 3) * positive("speed", speed)
    if one_of("grip", grip, ("clamp", "pin")) == "pin":
        positive("length", length)
        frames += 1
    frames = [positive("seed", seed) for _ in range(0)] if seed else 0
    count("own", own, least)
    count("least", least, 10)
    def inner():
        return 1
    if frames:
        return None
    count("late", late, 3)
"""


@pytest.mark.parametrize(
    ("settings", "said"),
    [
        ({"points": 2}, "points = 2: expected a whole number of 3 or more"),
        ({"speed": "-1"}, "speed = -1.0: expected a positive number"),
        ({"grip": "pinn"}, "grip = 'pinn': expected one of 'clamp', 'pin' (did you mean 'pin'?)"),
    ],
)
def test_values_are_checked_as_the_text_of_a_scene_checks_them(settings, said, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(CHECKED)
    with refused(said):
        require_settings(str(path), settings)


@pytest.mark.parametrize(
    "settings",
    [{"length": "-1"}, {"seed": -1}, {"late": 1}, {"least": 2}, {"own": 1}, {"points": 3, "grip": "pin"}],
    ids=lambda settings: next(iter(settings)),
)
def test_checks_that_a_scene_may_not_make_are_left_to_it(settings, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(CHECKED)
    require_settings(str(path), settings)


@pytest.mark.parametrize("name", ["points", "speed", "grip"])
def test_checks_of_other_names_are_not_those_of_the_package(name, tmp_path):
    path = tmp_path / "mine.py"
    path.write_text(CHECKED.replace("from warp_pd.device.checks import", "from mine_too import"))
    require_settings(str(path), {name: "-1" if name == "speed" else "2"})


@pytest.mark.parametrize(
    ("setting", "said"),
    [("nonsense=1", "nonsense is not an argument"), ("points=-3", "points = -3: expected a whole number of 3 or more")],
)
def test_wrong_settings_are_refused_before_warp_is_imported(setting, said):
    program = f"""
import sys
from warp_pd.__main__ import main
try:
    main(["run", "ball_penetration", "--set", "{setting}"])
except SystemExit as left:
    print(left.code, "warp" in sys.modules)
"""
    done = subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=60, check=True)
    assert done.stdout.split() == ["2", "False"] and said in done.stderr
