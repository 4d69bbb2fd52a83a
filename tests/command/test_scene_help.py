"""The help of a command lists the arguments of the scene that it names."""

import inspect
import subprocess
import sys

import pytest
from small_runs import cli

from warp_pd.command.scene_files import load_scene, scene_names
from warp_pd.command.scene_help import scene_arguments


@pytest.mark.parametrize("name", scene_names())
def test_every_argument_of_every_scene_is_explained(name):
    module = load_scene(name)
    rows = scene_arguments(module)
    assert [text.partition(":")[0] for text, _ in rows] == list(inspect.signature(module.build).parameters)
    assert not [text for text, said in rows if not said.endswith(".")]


def test_explanations_name_arguments_that_exist():
    for name in scene_names():
        build = load_scene(name).build
        _, _, section = (inspect.getdoc(build) or "").partition("Args:\n")
        explained = [line.partition(":")[0].strip() for line in section.splitlines() if line[4:5].strip()]
        assert set(explained) <= set(inspect.signature(build).parameters), name


@pytest.mark.parametrize("command", ["run", "plan", "sweep", "fit"])
@pytest.mark.parametrize(
    "arguments", [("notched_strip", "--help"), ("--help", "notched_strip"), ("--points", "9", "notched_strip", "-h")]
)
def test_help_lists_names_types_defaults_and_meanings(command, arguments):
    done = cli(command, *arguments)
    words = " ".join(done.output.split())
    assert done.exit_code == 0
    assert "critical_strain: float = 0.006 Strain at which a bond breaks [-]." in words
    assert 'ends: str = free `ends` are "free" to contract' in words
    assert "--set NAME=" in words and "A membrane strip with a notch is torn" in words


def test_help_without_a_scene_says_how_to_get_it():
    done = cli("run", "--help")
    assert done.exit_code == 0 and "warp-pd run SCENE --help" in " ".join(
        done.output.replace("main", "warp-pd").split()
    )


def test_help_on_a_scene_of_ones_own(tmp_path):
    file = tmp_path / "mine.py"
    file.write_text(
        '"""A sheet of mine."""\n'
        "def build(points=9, *, width, speed: 'float | None' = None, mass=2.0):\n"
        '    """Build.\n    Args:\n        width: How wide\n            it is [m].\n    Returns:\n        mass: no.\n'
        '    """\n'
    )
    words = " ".join(cli("run", file, "--help").output.split())
    assert "points=9 Points along x. width How wide it is [m]." in words
    assert "speed: float | None = None Speed of the moving support or body [m/s]. mass=2.0 A sheet of mine." in words


def test_help_on_a_scene_that_does_not_exist_is_one_line():
    done = cli("run", "notched", "--help")
    assert done.exit_code == 2 and "did you mean 'notched_strip'?" in done.output and "Usage" not in done.output


def test_the_help_waits_for_no_warp():
    asked = "from warp_pd.__main__ import main; import sys; print(sorted({'warp', 'scipy', 'h5py'} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", asked], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"
