"""A run: the files that it leaves, what it reports, and how it is interrupted."""

import csv
import json
import shutil
import signal
import subprocess
import sys
import time

from small_runs import BALL, cli


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
        assert cli("run", "ball_penetration", "--points", "21", "--out", folder, *wrong).exit_code == 2
    assert {p.name: p.read_bytes() for p in folder.iterdir()} == before


def test_the_ball_scene_in_vtk(ball):
    from vtkmodules.vtkIOHDF import vtkHDFReader

    reader = vtkHDFReader()
    reader.SetFileName(str(ball / "frames.vtkhdf"))
    reader.UpdateInformation()
    assert reader.GetNumberOfSteps() == 25
    cells, damage = [], []
    for step in (0, 24):
        reader.SetStep(step)
        reader.Update()
        data = reader.GetOutputAsDataSet()
        cells.append(data.GetNumberOfCells())
        damage.append(data.GetPointData().GetArray("damage").GetRange()[1])
    assert cells[1] < cells[0]
    assert damage[0] == 0.0 < damage[1] <= 1.0


def test_the_ball_scene_in_usd(ball):
    from pxr import Usd, UsdGeom, UsdValidation

    stage = Usd.Stage.Open(str(ball / "animation.usd"))
    context = UsdValidation.ValidationContext(UsdValidation.ValidationRegistry().GetOrLoadAllValidators())
    assert [e.GetName() for e in context.Validate(stage)] == []
    mesh = UsdGeom.Mesh(stage.GetPrimAtPath("/World/Sheet"))
    for frame in range(25):
        points = mesh.GetPointsAttr().Get(frame)
        indices, counts = mesh.GetFaceVertexIndicesAttr().Get(frame), mesh.GetFaceVertexCountsAttr().Get(frame)
        assert UsdGeom.Mesh.ValidateTopology(indices, counts, len(points))[0]
        assert len(mesh.GetNormalsAttr().Get(frame)) == len(points)
    assert any(p.GetTypeName() == "Sphere" for p in stage.Traverse())


def test_ctrl_c_ends_at_a_frame_and_can_be_resumed(tmp_path):
    command = [sys.executable, "-m", "warp_pd.__main__", "run", *BALL, "--frames", "200", "--no-pictures",
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
    done = cli("run", *BALL, "--frames", "200", "--no-usd", "--no-pictures", "--resume", "--out", tmp_path)
    assert done.exit_code == 0, done.output
