"""warp-pd fit, and the tearing energy of a test."""

import json
from types import SimpleNamespace

import numpy as np
import pytest
from click.testing import CliRunner
from helpers import refused

from warp_pd.__main__ import build_scene, main
from warp_pd.fitting import data, tearing_energy
from warp_pd.run.folder import claimed_folder

SMALL = {"points": 9, "shape": "square", "lock": 20.0, "horizon": 2.015}


def run(*arguments):
    return CliRunner().invoke(main, ["fit", *map(str, arguments)])


@pytest.fixture(scope="module")
def bulge_csv(tmp_path_factory):
    path = tmp_path_factory.mktemp("fit") / "bulge.csv"
    lines = ["pressure [kPa], height [mm]"]
    for kilopascal in (8.0, 16.0, 32.0):
        scene = build_scene("bulge_test", {**SMALL, "mu": 0.3e6, "pressure": 1e3 * kilopascal, "load_steps": 2})
        lines.append(f"{kilopascal}, {1e3 * scene.run(device='cpu').history[-1]['center_deflection']:.9g}")
    path.write_text("\n".join([*lines, "40,"]))
    return path


def test_the_command_fits_a_scene_and_says_how_to_run_it(bulge_csv, tmp_path, monkeypatch):
    read, reads = data._text_of, []
    monkeypatch.setattr(data, "_text_of", lambda path: reads.append(path) or read(path))
    options = ["--set", "shape=square", "--set", "lock=20", "--set", "mu=4e5", "--points", 9, "--device", "cpu"]
    done = run(
        "bulge_test", bulge_csv, "--vary", "mu", "--measure", "center_deflection", "--bounds", "mu=1e5:1e6", *options,
        "--out", tmp_path / "out",
    )  # fmt: skip
    assert done.exit_code == 0, done.output
    assert reads == [bulge_csv]
    assert "line 5: height is missing: the row is left out" in done.output
    last = done.output.strip().splitlines()[-1]
    assert last.startswith("run the fitted scene: warp-pd run bulge_test --points 9 --set shape=square --set lock=20")
    saved = json.loads((tmp_path / "out" / "fit.json").read_text())
    assert saved["constants"]["mu"]["value"] == pytest.approx(0.3e6, rel=1e-5)
    assert saved["run"] in last
    assert (tmp_path / "out" / "fit.png").is_file()
    again = run("bulge_test", bulge_csv, "--vary", "mu", "--measure", "center_deflection", "--out", tmp_path / "out")
    assert again.exit_code == 2 and "it contains fit.json; expected a folder without results" in again.output
    with claimed_folder(tmp_path / "out") as folder:
        assert folder.name == "out-2"


@pytest.mark.parametrize(
    ("options", "said"),
    [
        (["--vary", "nu"], "vary = 'nu': expected an argument of the scene"),
        (["--vary", "mu", "--bounds", "mu=3"], "--bounds 'mu=3': expected NAME=LOW:HIGH"),
        (["--vary", "mu", "--bounds", "mu=3:2"], "expected LOW below HIGH"),
        (["--vary", "mu", "--loss", "l1"], "--loss = 'l1'"),
        (["--vary", "mu", "--set", "nu=3"], "nu is not an argument of this scene"),
        (["--vary", "mu", "--out", __file__], "expected a writable folder"),
    ],
)
def test_wrong_options_are_refused_in_a_line(bulge_csv, options, said):
    done = run("bulge_test", bulge_csv, "--measure", "center_deflection", "--points", 9, "--device", "cpu", *options)
    assert done.exit_code == 2
    assert said in done.output
    assert len(done.output.strip().splitlines()) <= 2


def test_a_file_with_one_column_is_told_which_other(tmp_path):
    (tmp_path / "one.csv").write_text("pressure [Pa]\n1\n2\n")
    done = run("pressure", tmp_path / "one.csv", "--vary", "horizon", "--points", 9, "--device", "cpu")
    assert done.exit_code == 2
    assert "one.csv: expected a column beside 'pressure', of one of center_deflection" in done.output


def strip(stiffness, onset):
    """A scene like pure_shear_tear, in closed form: load k s, release rate k s^2; it tears at `onset` Gc."""

    def build(tearing_energy=2.0):
        def run(device):
            stretches = np.linspace(0.0, 2.0 * np.sqrt(tearing_energy / stiffness), 400)
            ratios = stiffness * stretches**2 / tearing_energy
            rows = [{"load": stiffness * s, "release_ratio": r} for s, r in zip(stretches, ratios, strict=True)]
            summary = {"measures": {"onset_ratio": {"value": onset}}}
            return SimpleNamespace(history=rows, summary=summary, status="finished")

        return SimpleNamespace(run=run)

    return build


@pytest.mark.parametrize("guess", [0.3, 5.0, 40.0])
def test_tearing_energy_is_that_of_the_load_at_tearing(guess):
    load = 7.0 * np.sqrt(1.1 * 5.0 / 7.0)
    found = tearing_energy(strip(7.0, 1.1), load, {"tearing_energy": guess})
    assert found.energy == pytest.approx(5.0, rel=0.02)
    assert found.released == pytest.approx(5.5, rel=0.02)
    assert abs(found.error) <= 0.02
    assert found.runs <= 3


def test_a_strip_that_does_not_tear_is_refused():
    with refused(match="did not tear"):
        tearing_energy(strip(7.0, None), 1.0)
    with refused(match="expected a scene with this argument"):
        tearing_energy(lambda: None, 1.0)
