"""Whole runs: files, restart, wrong input, the command line, the plan."""

import csv
import json
import os
import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from click.testing import CliRunner
from helpers import NEO, square

from warp_pd import (
    BodyForce,
    BondAssociated,
    CriticalEnergy,
    CriticalStretch,
    Explicit,
    Fixed,
    InputError,
    Measure,
    Motion,
    Newton,
    Nodal,
    Outcome,
    Pressure,
    Relaxation,
    RigidBall,
    Sheet,
    Simulation,
)
from warp_pd.checks import point_indices
from warp_pd.cli import build_scene, main

SMALL = ["--points", "21", "--horizon", "2.015", "--device", "cpu", "--quiet"]


def cli(*arguments):
    return CliRunner().invoke(main, list(arguments))


@pytest.fixture(scope="module")
def ball(tmp_path_factory):
    """A small ball scene, torn."""
    folder = tmp_path_factory.mktemp("ball")
    done = cli("run", "ball_penetration", *SMALL, "--frames", "24", "--out", str(folder))
    assert done.exit_code == 0, done.output
    return folder


def test_the_ball_scene_leaves_what_it_promises(ball):
    names = {p.name for p in ball.iterdir()}
    assert names >= {"frames.vtkhdf", "animation.usd", "summary.json", "history.csv", "restart.npz", "damage.png"}
    assert not [n for n in names if n.endswith(".part") or n.startswith(".")]
    summary = json.loads((ball / "summary.json").read_text())
    assert summary["status"] == "finished"
    with (ball / "history.csv").open() as stream:
        assert min(float(row["lowest_point"]) for row in csv.DictReader(stream)) < -0.1
    assert summary["measures"]["torn_area_share"]["value"] > 0.0
    assert abs(summary["energy"]["balance_error"]) < 0.01
    expected = ("scene section device precision force horizon points bonds steps dt stable_dt wall_s setup_s "
                "point_steps_per_s bytes_per_point energy measures status")  # fmt: skip
    assert set(expected.split()) <= set(summary)


def test_wrong_input_leaves_an_earlier_run_alone(ball, tmp_path):
    folder = tmp_path / "earlier"
    shutil.copytree(ball, folder)
    before = {p.name: p.read_bytes() for p in folder.iterdir()}
    for wrong in (["--device", "gpu"], ["--horizon", "0.5"], ["--precision", "16"], ["--resume", "--set", "damping=9"]):
        assert cli("run", "ball_penetration", "--points", "21", "--out", str(folder), *wrong).exit_code == 2
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before


def test_the_pictures_of_an_earlier_run_are_cleared_and_others_kept(ball, tmp_path):
    folder = tmp_path / "earlier"
    shutil.copytree(ball, folder)
    (folder / "mine.png").write_bytes(b"mine")
    done = cli("run", "pressure", "--points", "9", "--device", "cpu", "--quiet", "--no-pictures", "--out", str(folder))
    assert done.exit_code == 0, done.output
    assert {p.name for p in folder.glob("*.png")} == {"mine.png"}


def test_broken_scene_files_end_with_one_line(tmp_path):
    for text, said in (
        ("def build(:\n", "line 1"),
        ("build = 3\n", "no function build"),
        ("def build(): return 3\n", "int"),
        ("import numpyy\n", "line 1: ModuleNotFoundError"),
        ("def build():\n    return sheet()\n\n\ndef sheet():\n    return Sheet(3)\n", "line 6: NameError"),
    ):
        (tmp_path / "mine.py").write_text(text)
        done = cli("run", str(tmp_path / "mine.py"))
        assert done.exit_code == 2 and said in done.output and "Traceback" not in done.output


def test_the_ball_scene_in_vtk(ball):
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(ball / "frames.vtkhdf"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 25
    cells = []
    for step in (0, 24):
        reader.SetStep(step)
        reader.Update()
        data = reader.GetOutputAsDataSet()
        cells.append(data.GetNumberOfCells())
        assert data.GetPointData().GetArray("damage").GetRange()[1] <= 1.0
    assert cells[1] < cells[0]


def test_the_ball_scene_in_usd(ball):
    from pxr import Usd, UsdGeom, UsdValidation

    stage = Usd.Stage.Open(str(ball / "animation.usd"))
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    assert [e.GetName() for e in context.Validate(stage)] == []
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Sheet"))
    for frame in range(25):
        points = mesh.GetPointsAttr().Get(frame)
        indices, counts = mesh.GetFaceVertexIndicesAttr().Get(frame), mesh.GetFaceVertexCountsAttr().Get(frame)
        assert UsdGeom.Mesh.ValidateTopology(indices, counts, len(points))
        assert len(mesh.GetNormalsAttr().Get(frame)) == len(points)
    assert any(p.GetTypeName() == "Sphere" for p in stage.Traverse())


def state_of(folder):
    with np.load(folder / "restart.npz") as stored:
        return {name: stored[name] for name in ("displacement", "velocity", "alive", "work", "released")}


def test_a_resumed_run_equals_the_uninterrupted_one(ball, tmp_path):
    """Killed in the middle of the tear, then resumed: same state bit for bit, same files."""
    command = [sys.executable, "-m", "warp_pd.cli", "run", "ball_penetration", *SMALL, "--frames", "24", "--no-pictures",  # noqa: E501
               "--out", str(tmp_path)]  # fmt: skip
    running = subprocess.Popen(command, stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
    history = tmp_path / "history.csv"
    deadline = time.time() + 240
    while not (history.exists() and len(history.read_text().splitlines()) > 16):
        assert time.time() < deadline and running.poll() is None
        time.sleep(0.01)
    running.send_signal(signal.SIGKILL)
    running.wait()
    with h5py.File(tmp_path / "frames.vtkhdf") as file:
        assert file["VTKHDF/Steps"].attrs["NSteps"] >= 15
    assert not (tmp_path / "summary.json").exists()
    done = cli("run", "ball_penetration", *SMALL, "--frames", "24", "--no-pictures", "--resume", "--out", str(tmp_path))
    assert done.exit_code == 0, done.output
    for name, value in state_of(ball).items():
        assert (state_of(tmp_path)[name] == value).all(), name
    with h5py.File(ball / "frames.vtkhdf") as one, h5py.File(tmp_path / "frames.vtkhdf") as two:
        assert (one["VTKHDF/Points"][:] == two["VTKHDF/Points"][:]).all()
        assert (
            one["VTKHDF/Connectivity"] if "VTKHDF/Connectivity" in one else one["VTKHDF/Polygons/Connectivity"]
        ).shape
    rows = [len((f / "history.csv").read_text().splitlines()) for f in (ball, tmp_path)]
    assert rows[0] == rows[1] == 26


@pytest.mark.parametrize("usd", [True, False])
def test_what_a_killed_run_left_unfinished_is_cleared(usd, tmp_path):
    left = [".animation.unfinished.usdc", ".animation.copy.usdc", ".frames.vtkhdf.unfinished", "restart.npz.part",
            "history.csv.part", "summary.json.part", "damage.png.part"]  # fmt: skip
    sheet = square(7)
    simulation = Simulation(sheet, BondAssociated(NEO), Explicit(1e-3, frames=2), [Fixed(sheet.edges())])
    (tmp_path / ".mine.usdc").write_bytes(b"mine")
    for resume in (False, True):
        for name in left:
            (tmp_path / name).write_bytes(b"half")
        assert simulation.run(out=tmp_path, device="cpu", usd=usd, resume=resume).status == "finished"
        results = {"frames.vtkhdf", "history.csv", "restart.npz", "summary.json"} | (
            {"animation.usd"} if usd else set()
        )
        assert {p.name for p in tmp_path.iterdir()} == {".mine.usdc"} | results


def test_a_run_whose_frames_are_gone_is_not_resumed(ball, tmp_path):
    folder = tmp_path / "gone"
    shutil.copytree(ball, folder)
    (folder / "frames.vtkhdf").unlink()
    done = cli("run", "ball_penetration", *SMALL, "--frames", "24", "--no-pictures", "--resume", "--out", str(folder))
    assert done.exit_code == 2
    assert "still has its frames.vtkhdf" in done.output


def test_ctrl_c_ends_at_a_frame_and_can_be_resumed(tmp_path):
    command = [sys.executable, "-m", "warp_pd.cli", "run", "ball_penetration", *SMALL, "--frames", "200", "--no-pictures",  # noqa: E501
               "--no-usd", "--out", str(tmp_path)]  # fmt: skip
    running = subprocess.Popen(command, stderr=subprocess.PIPE, text=True)
    while not (tmp_path / "history.csv").exists():
        assert running.poll() is None
        time.sleep(0.05)
    running.send_signal(signal.SIGINT)
    _, errors = running.communicate(timeout=120)
    assert running.returncode == 130
    assert "--resume" in errors
    assert json.loads((tmp_path / "summary.json").read_text())["status"] == "interrupted"
    done = cli(
        "run",
        "ball_penetration",
        *SMALL,
        "--frames",
        "200",
        "--no-usd",
        "--no-pictures",
        "--resume",
        "--out",
        str(tmp_path),
    )
    assert done.exit_code == 0, done.output


@pytest.mark.parametrize("content", [b"", b"not a zip", None])
def test_a_damaged_restart_file_is_named(ball, tmp_path, content):
    whole = (ball / "restart.npz").read_bytes()
    (tmp_path / "restart.npz").write_bytes(whole[: len(whole) // 2] if content is None else content)
    done = cli("run", "ball_penetration", *SMALL, "--frames", "24", "--resume", "--out", str(tmp_path))
    assert done.exit_code == 2
    assert "restart.npz" in done.output and "damaged" in done.output


def test_a_restart_file_of_other_settings_is_refused(ball, tmp_path):
    shutil.copy(ball / "restart.npz", tmp_path / "restart.npz")
    done = cli(
        "run", "ball_penetration", *SMALL, "--frames", "24", "--set", "damping=1", "--resume", "--out", str(tmp_path)
    )
    assert done.exit_code == 2 and "other settings (damping = 0.0, here 1.0)" in done.output
    done = cli(
        "run", "ball_penetration", *SMALL, "--frames", "12", "--precision", "64", "--resume", "--out", str(tmp_path)
    )
    assert done.exit_code == 2 and "other settings (frames = 24, here 12; precision = 32, here 64)" in done.output
    done = cli("run", "ball_penetration", *SMALL, "--resume", "--out", str(tmp_path / "new"))
    assert done.exit_code == 2 and "does not exist" in done.output
    assert not (tmp_path / "new").exists()


def test_a_setting_that_only_a_measure_reads_must_be_the_same(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from warp_pd import *\n"
        "def build(at=10):\n"
        "    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=5)\n"
        "    law = BondAssociated(NeoHookean(mu=1e3, bulk=1e5))\n"
        "    seen = Measure('seen', '1', lambda built, frame: float(at))\n"
        "    return Simulation(sheet, law, Explicit(1e-4, frames=1), measures=[seen])\n"
    )
    command = [
        "run",
        str(tmp_path / "mine.py"),
        "--device",
        "cpu",
        "--quiet",
        "--no-usd",
        "--out",
        str(tmp_path / "out"),
    ]
    assert cli(*command).exit_code == 0
    assert cli(*command, "--resume").exit_code == 0
    done = cli(*command, "--resume", "--set", "at=100")
    assert done.exit_code == 2 and "other settings (at = 10, here 100)" in done.output


def test_what_differs_from_a_restart_file_is_named_without_a_scene(tmp_path):
    def simulation(points=7, density=1000.0, **changes):
        sheet = square(points, density=density)
        given = {"force": BondAssociated(NEO), "solver": Explicit(1e-3, frames=2), **changes}
        return Simulation(sheet, loads=[Fixed(sheet.edges()), Pressure(2.0)], **given)

    simulation().run(out=tmp_path, device="cpu", usd=False)
    for other, said in (
        ({"density": 900.0}, "sheet.density = 1000.0, here 900.0"),
        ({"force": BondAssociated(NEO, horizon=1.5)}, "force.horizon = 2.015, here 1.5"),
        ({"solver": Newton()}, "precision = 32, here 64; solver = Explicit, here Newton"),
        ({"damage": CriticalStretch(2.0)}, "damage = None, here CriticalStretch"),
        ({"points": 9}, "sheet.points = array (49, 2)"),
    ):
        with pytest.raises(InputError, match="other settings") as refused:
            simulation(**other).run(out=tmp_path, device="cpu", usd=False, resume=True)
        assert said in str(refused.value) and "\n" not in str(refused.value)


def test_a_diverging_run_ends_with_code_3_and_its_cause(tmp_path):
    done = cli("run", "ball_penetration", *SMALL, "--set", "safety=1.2", "--frames", "8", "--no-usd", "--no-pictures",
               "--out", str(tmp_path))  # fmt: skip
    assert done.exit_code == 3
    assert (
        "diverged" in done.output and "likely cause: the step" in done.output and "above the stable step" in done.output
    )
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["status"] == "diverged"
    with h5py.File(tmp_path / "frames.vtkhdf") as file:
        assert np.isfinite(file["VTKHDF/Points"][:]).all()


def test_a_start_that_is_not_finite_ends_with_code_3_and_leaves_nothing(tmp_path):
    done = cli("run", "double_notch", "--points", "20", "--horizon", "2.015", "--set", "roughness=100", "--device",
               "cpu", "--quiet", "--out", str(tmp_path))  # fmt: skip
    assert done.exit_code == 3, done.output
    assert "not finite at the start" in done.output and "initial displacement" in done.output
    assert not list(tmp_path.iterdir())


def test_the_likely_cause_fits_the_scene():
    """Nothing can tear here, and no step in time could be smaller."""
    result = build_scene("pressure_static", {"points": 11, "pressure": 500.0}).run(device="cpu")
    assert result.status == "diverged"
    assert "try a smaller load" in result.summary["message"]
    assert "torn" not in result.summary["message"] and "safety" not in result.summary["message"]


def test_pictures_know_the_ball_and_say_when_nothing_happens(ball, tmp_path, monkeypatch):
    from matplotlib.axes import Axes

    from warp_pd.output import plots

    first, last = plots.frames_at(ball, [0.0, 4.0])
    assert (first.when, last.when) == ("t = 0 s", "t = 4 s")
    assert first.ball == (pytest.approx([0.5, 0.5, 0.075]), 0.15)
    assert last.ball == (pytest.approx([0.5, 0.5, -0.325]), 0.15)
    said = []
    monkeypatch.setattr(Axes, "text", lambda axes, x, y, text, **style: said.append(text))
    for length in (0.0, 1.0):
        history = [{"time": t, "crack_length": t * length} for t in (0.0, 1.0)]
        plots.curves(tmp_path / "crack.png", history, ["crack_length"], ylabel="m")
    assert said == ["zero throughout"]


def test_draw_refuses_the_scene_of_another_run(ball):
    done = cli("draw", str(ball), "--scene", "double_notch")
    assert done.exit_code == 2 and "this run is of 'ball_penetration'" in done.output


def test_not_converged_ends_with_code_3(tmp_path):
    sheet = square(9)
    simulation = Simulation(
        sheet, BondAssociated(NEO), Relaxation(most_steps=50), [Fixed(sheet.edges()), Pressure(5.0)]
    )
    assert simulation.run(device="cpu").status == "not converged"


WRONG_LINES = [
    (["run", "ball_penetratoin"], "did you mean 'ball_penetration'"),
    (["run", "pressure", "--set", "presure=3"], "did you mean 'pressure'"),
    (["run", "pressure", "--set", "points=many"], "points = 'many': expected a whole number"),
    (["run", "pressure", "--set", "pressure"], "allowed is name=value"),
    (["run", "pressure", "--points", "2"], "points = 2: expected a whole number of 3 or more"),
    (["run", "pressure", "--horizon", "0.9"], "horizon = 0.9: allowed is 1 spacing or more"),
    (["run", "pressure", "--horizon", "1.2"], "horizon = 1.2: allowed on a lattice is 1.42 or more"),
    (["run", "pressure", "--horizon", "nan"], "horizon = nan"),
    (["run", "pressure", "--horizon", "9.015", "--weights", "corrected"], "allowed up to 4.5"),
    (["run", "pressure", "--weights", "planar"], "did you mean 'plain'"),
    (["run", "pressure", "--device", "cuda:7"], "device = 'cuda:7': allowed here are"),
    (["run", "pressure", "--precision", "16"], "precision = 16: allowed are 32, 64"),
    (["run", "pressure", "--out", "/proc/nowhere"], "out = '/proc/nowhere': allowed is a folder that can be written"),
    (["run", "pressure", "--out", ""], "out = '': allowed is a folder that can be written"),
    (["run", "pressure", "--set", "points=31", "--points", "41"], "points = 41 is given already"),
    (["run", "pressure", "--horizon", "200", "--points", "101"], "horizon = 200.0: allowed is up to 16 spacings"),
    (["run", "pressure", "--horizon", "4.15", "--points", "4"], "horizon = 4.15: allowed is up to 3 spacings"),
    (["run", "off_plane_tear", "--duration", "3"], "it lasts travel / speed"),
    (["run", "double_notch", "--frames", "-3"], "frames = -3: expected a whole number of 1 or more"),
    (["run", "nothing.py"], "the file does not exist"),
    (["run", "pressure", "--points", "x"], "'x' is not a valid integer"),
    (["runn"], "No such command 'runn'"),
    (["run", "pressure", "--set", "=3"], "--set '=3': allowed is name=value"),
    (["run", "ball_penetration", "--points", "-5"], "points = -5: expected a whole number of 3 or more"),
    (["run", "ball_penetration", "--horizon", "nan"], "horizon = nan"),
    (["info", "nothing.usd"], "it does not exist"),
    (["info", __file__], "allowed are .vtkhdf, .usd and .json"),
]


@pytest.mark.parametrize(
    ("arguments", "text"), WRONG_LINES, ids=[" ".join(map(os.path.basename, a)) for a, _ in WRONG_LINES]
)
def test_wrong_input_ends_with_one_line(arguments, text, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    done = cli(*arguments)
    assert done.exit_code == 2, done.output
    lines = [line for line in done.output.splitlines() if line.startswith("warp-pd:")]
    assert len(lines) == 1 and text in lines[0]
    left = list(tmp_path.rglob("*"))
    assert not [p for p in left if p.is_file()]


def cloud(**changes):
    points = square(5).points.copy()
    return points, {"thickness": 1e-3, "density": 1.0, **changes}


NAN = float("nan")
WRONG_PARTS = [
    (lambda: Sheet.rectangle(0.0, 1.0, thickness=1.0, density=1.0), "width = 0.0"),
    (lambda: Sheet.rectangle(1.0, -1.0, thickness=1.0, density=1.0), "height = -1.0"),
    (lambda: Sheet.rectangle(NAN, 1.0, thickness=1.0, density=1.0), "width = nan"),
    (lambda: square(5, thickness=0.0), "thickness = 0.0"),
    (lambda: square(5, density=NAN), "density = nan"),
    (lambda: square(5).cut((2.0, 2.0), (3.0, 3.0)), "crosses no bond"),
    (lambda: square(5).cut((0.01, 0.01), (0.01, 0.01)), "segment of some length"),
    (lambda: square(5).hole((5.0, 5.0), 0.01), "holds no point"),
    (lambda: square(5).hole((0.05, 0.05), 1.0), "leaves no sheet"),
    (lambda: square(5).inclusion((0.0, 0.0), 1e-3), "holds 1 points"),
    (lambda: square(5).edges("middle"), "edge = 'middle'"),
    (
        lambda: Sheet.from_points(np.vstack([cloud()[0], cloud()[0][3]]), **cloud()[1]),
        r"points\[3\] and points\[25\] coincide",
    ),
    (lambda: Sheet.from_points(np.array([[0.0, 0.0], [1.0, 0.0], [2.0, 0.0]]), **cloud()[1]), "one line"),
    (lambda: Sheet.from_points(np.full((4, 2), NAN), **cloud()[1]), r"points\[0\]"),
    (lambda: Sheet.from_points(np.zeros((4, 3)), **cloud()[1]), r"shape \(4, 3\)"),
    (lambda: RigidBall(0.0, (0, 0, 0)), "diameter = 0.0"),
    (lambda: RigidBall(1.0, (0, NAN, 0)), "start"),
    (lambda: CriticalStretch(1.0), "stretch = 1.0"),
    (lambda: Explicit(0.0), "duration = 0.0"),
    (lambda: Explicit(1.0, frames=0), "frames = 0"),
    (lambda: Explicit(1.0, damping=-1.0), "damping = -1.0"),
    (lambda: Explicit(1.0, safety=2.0), "safety = 2.0"),
    (lambda: Relaxation(tolerance=0.0), "tolerance = 0.0"),
    (lambda: BodyForce((1.0, NAN, 0.0)), "BodyForce.value"),
    (lambda: point_indices("points", [0.5, 3.9], 9), "points = .* point numbers"),
    (lambda: point_indices("points", np.ones(8, bool), 9), "mask of 9"),
    (lambda: built_with(solver="explicit"), "solver = 'explicit'"),
    (lambda: built_with(loads=Fixed([0])), "loads = "),
    (lambda: built_with(loads=[[Fixed([0])]]), r"loads\[0\] is of type list"),
    (lambda: built_with(outcomes=[5]), r"outcomes\[0\] is of type int"),
    (lambda: built_with(measures=[Measure("a\nb", "s", lambda built, frame: 0.0)]), "name of a measure"),
    (
        lambda: built_with(
            measures=[Measure("m", "s", lambda built, frame: 0.0)], outcomes=[Outcome("m", "s", lambda history: 0.0)]
        ),
        "two numbers",
    ),
    (lambda: built_with(damage=1.3), "damage = 1.3"),
    (lambda: built_with(measures=[Measure("time", "s", lambda built, frame: 0.0)]), "'time'"),
    (lambda: built_with(loads=[Motion([3], [0.0], x=1.0), Fixed([3])]), "Fixed.points holds point 3 at .* component x"),
    (
        lambda: built_with(loads=[Fixed([3]), Motion([3], [0.0], z=1.0)]),
        "Motion.points holds point 3 at .* component z",
    ),
    (
        lambda: built_with(force=Nodal(NEO), damage=CriticalEnergy(1.0)),
        "CriticalEnergy with Nodal",
    ),
    (lambda: Motion([0], [0.0, 1.0]).mask(), "at least one prescribed"),
    (lambda: Motion([0], [1.0, 0.0], x=1.0).schedule(), "rising"),
    (lambda: Motion([0], [0.0, 1.0], x=[1.0, 2.0, 3.0]).schedule(), "3 values"),
    (lambda: Motion([0], [0.0, 1.0], x=[0.0, NAN]).schedule(), r"Motion.x\[1\] = nan"),
    (lambda: Motion([0], [0.0, 1.0], y="fast").schedule(), "Motion.y = 'fast'"),
    (lambda: Motion([0], ["soon", 1.0], x=1.0).schedule(), "Motion.times = "),
    (lambda: built_with(initial_displacement=np.full((25, 3), NAN)), r"initial_displacement\[0, 0\] = nan"),
    (lambda: built_with(initial_velocity="none"), "initial_velocity = 'none'"),
    (lambda: Motion([0], [], x=[]).schedule(), "at least one"),
    (lambda: Motion([0], [[0.0, 1.0]], x=[0.0, 1.0]).schedule(), "rising"),
    (
        lambda: built_with(loads=[Motion([3], [0.0, 1.0], y=[1.0, 0.0])]),
        r"Motion.y is 1 m at t = 0, 1 m from where its points are",
    ),
    (lambda: Sheet.rectangle(1.0, 1.0, thickness=1.0, density=1.0, points=10**6), "points = 1000000 with layers"),
    (lambda: Explicit("1"), "duration = '1'"),
    (lambda: Explicit(1.0, frames=[0.5, "end"]), "frames = "),
    (lambda: Fixed([0], "xw").mask(), "'xw'"),
    (lambda: BondAssociated(NEO, influence="cubic"), "influence = 'cubic'"),
]


@pytest.mark.parametrize(("make", "text"), WRONG_PARTS, ids=[t for _, t in WRONG_PARTS])
def test_wrong_parts_are_named(make, text):
    with pytest.raises(InputError, match=text) as caught:
        make()
    assert "\n" not in str(caught.value)


def test_a_point_without_neighbours_is_named():
    points = np.vstack([square(5).points, [[0.4, 0.05]]])
    sheet = Sheet.from_points(points, thickness=1e-3, density=1.0, areas=np.full(26, 6e-4),
                              triangles=square(5).triangles, spacing=0.025)  # fmt: skip
    with pytest.raises(InputError, match=r"points\[25\] at \[0.4, 0.05\] has no neighbour"):
        Simulation(sheet, BondAssociated(NEO, weights="plain"), Explicit(1.0)).build("cpu")


def test_a_point_cannot_be_held_twice():
    sheet = square(5)
    loads = [Fixed([3]), Motion([3], [0.0], x=1.0)]
    with pytest.raises(InputError, match="point 3"):
        Simulation(sheet, BondAssociated(NEO), Explicit(1.0), loads=loads).build("cpu")


def built_with(**parts):
    values = {"force": BondAssociated(NEO), "solver": Explicit(1.0), **parts}
    return Simulation(square(5), **values).build("cpu")


def test_a_mask_of_all_points_is_their_numbers():
    assert (point_indices("points", np.arange(9) > 6, 9) == [7, 8]).all()


def names_of(plan):
    rows = [line.strip().split("  ")[0] for line in plan.splitlines() if line.startswith("  ")]
    return {name for row in rows for name in row.split(", ")}


def one_frame(tmp_path, **parts):
    simulation = Simulation(square(5), BondAssociated(NEO), Explicit(1e-4, frames=1), **parts)
    return simulation.run(device="cpu", out=tmp_path, usd=False)


@pytest.mark.parametrize(("value", "said"), [(lambda h: 1 / 0, "ZeroDivisionError"), (lambda h: "many", "'many'")])
def test_an_outcome_that_fails_leaves_the_other_numbers(tmp_path, value, said):
    kept = Measure("kept", "1", lambda built, frame: 3.0)
    one_frame(tmp_path, measures=[kept], outcomes=[Outcome("peak", "N", value)])
    summary = json.loads((tmp_path / "summary.json").read_text())
    assert summary["measures"]["kept"]["value"] == 3.0 and summary["measures"]["peak"]["value"] is None
    assert any("Outcome 'peak'" in note and said in note for note in summary["notes"])


def test_a_measure_that_fails_and_pictures_that_fail_are_told_in_a_line(tmp_path):
    with pytest.raises(InputError, match="Measure 'm' gives 'abc': allowed is a number"):
        one_frame(tmp_path, measures=[Measure("m", "1", lambda built, frame: "abc")])
    with pytest.raises(InputError, match="pictures: KeyError"):
        one_frame(tmp_path, pictures=lambda history, folder: history[0]["nothing"])
    assert (tmp_path / "summary.json").is_file()


def test_a_scene_of_ones_own_is_drawn_from_its_file(tmp_path):
    """Whatever it is called; and it may import the files beside it."""
    (tmp_path / "beside_it.py").write_text("POINTS = 5\n")
    (tmp_path / "pressure.py").write_text(
        "from beside_it import POINTS\n"
        "from warp_pd import *\n"
        "def draw(history, folder): (folder / 'mine.png').write_bytes(b'mine')\n"
        "def build():\n"
        "    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=POINTS)\n"
        "    law = BondAssociated(NeoHookean(mu=1e3, bulk=1e5))\n"
        "    return Simulation(sheet, law, Explicit(1e-4, frames=1), pictures=draw)\n"
    )
    out = tmp_path / "out"
    done = cli("run", str(tmp_path / "pressure.py"), "--device", "cpu", "--quiet", "--no-usd", "--out", str(out))
    assert done.exit_code == 0, done.output
    (out / "mine.png").unlink()
    done = cli("draw", str(out))
    assert done.exit_code == 0 and [p.name for p in out.glob("*.png")] == ["mine.png"]


@pytest.mark.parametrize("damage", [lambda path: path.unlink(), lambda path: os.truncate(path, 5000)])
def test_pictures_of_damaged_frames_are_refused_in_one_line(ball, tmp_path, damage):
    folder = tmp_path / "copy"
    shutil.copytree(ball, folder)
    damage(folder / "frames.vtkhdf")
    done = cli("draw", str(folder))
    assert done.exit_code == 2 and "frames.vtkhdf" in done.output and "Traceback" not in done.output
    assert len(done.output.strip().splitlines()) == 1


def test_the_plan_leaves_out_what_a_scene_does_not_use():
    sheet = square(9)
    law = BondAssociated(NEO, weights="plain")
    bare = names_of(Simulation(sheet, law, Explicit(1.0)).plan("cpu"))
    absent = {"alive", "damage", "released", "held", "external", "work", "dissipated", "damping", "impulse", "reference",  # noqa: E501
              "time", "scheduled", "tick", "prescribe", "project", "separate", "break_bonds", "begin_loads"}  # fmt: skip  # noqa: E501
    assert not bare & absent
    assert {"displacement", "velocity", "force", "mass", "drift", "kick"} <= bare
    full = names_of(
        Simulation(
            sheet, law, Explicit(1.0, damping=1.0), damage=CriticalStretch(2.0), contact=RigidBall(0.01, (0, 0, 1)),
            loads=[Fixed(sheet.edges()), Pressure(1.0, ramp=[(0, 0), (1, 1)])],
        ).plan("cpu")
    )  # fmt: skip
    assert full >= absent - {"prescribe"}


def test_the_plan_counts_bytes():
    done = cli("plan", "ball_penetration", "--points", "21", "--device", "cpu")
    assert done.exit_code == 0 and "a point" in done.output and "break_bonds" in done.output


def test_list_and_info(ball):
    listed = cli("list").output
    assert {"ball_penetration", "pressure", "tension"} <= {line.split()[0] for line in listed.splitlines()}
    told = cli("info", str(ball))
    assert told.exit_code == 0 and "25 frames" in told.output and "/World/Sheet" in told.output


def test_a_scene_of_ones_own(tmp_path):
    (tmp_path / "mine.py").write_text(
        "from warp_pd import *\n"
        "def build(points=9, speed=0.1):\n"
        "    sheet = Sheet.rectangle(1.0, 1.0, thickness=0.01, density=1000.0, points=points)\n"
        "    return Simulation(sheet, BondAssociated(NeoHookean(1e3, 1e5), weights='plain'), Explicit(0.1, frames=2),\n"
        "                      loads=[Fixed(sheet.edges('left'))])\n"
    )
    done = cli("run", str(tmp_path / "mine.py"), "--set", "speed=0.2", "--quiet", "--out", str(tmp_path / "out"))
    assert done.exit_code == 0, done.output
    assert json.loads((tmp_path / "out" / "summary.json").read_text())["settings"] == {"points": 9, "speed": 0.2}


def test_import_is_lean():
    """Importing the package pulls neither torch nor pxr, h5py or matplotlib."""
    code = (
        "import sys, warp_pd; print([m for m in ('torch', 'pxr', 'h5py', 'matplotlib', 'scipy') if m in sys.modules])"
    )
    assert (
        subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"
    )
