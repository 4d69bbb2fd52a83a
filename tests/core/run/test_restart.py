"""Restart files: a resumed run is the uninterrupted one bit for bit, and different settings are refused."""

import shutil
import signal
import subprocess
import sys
import time

import h5py
import numpy as np
import pytest
from helpers import NEO, StopAt, refused, square
from resumed_runs import restart_file
from small_runs import BALL, cli

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    Explicit,
    Fixed,
    InputError,
    Newton,
    Pressure,
    Simulation,
    TearingEnergy,
)


def datasets(path):
    """All datasets of an HDF5 file."""
    found = {}

    def keep(name, member):
        if isinstance(member, h5py.Dataset):
            found[name] = member[()]

    with h5py.File(path) as file:
        file.visititems(keep)
    return found


def test_a_resumed_run_equals_the_uninterrupted_one(ball, tmp_path):
    """Killed in the middle of the tear, then resumed: same state bit for bit, same files."""
    command = [
        sys.executable,
        "-m",
        "warp_pd.__main__",
        "run",
        *BALL,
        "--frames",
        "24",
        "--no-pictures",
        "--out",
        tmp_path,
    ]
    running = subprocess.Popen([*map(str, command)], stderr=subprocess.DEVNULL, stdout=subprocess.DEVNULL)
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
    done = cli("run", *BALL, "--frames", "24", "--no-pictures", "--resume", "--out", tmp_path)
    assert done.exit_code == 0, done.output
    (one, numbers), (two, other_numbers) = restart_file(ball), restart_file(tmp_path)
    assert numbers == other_numbers
    assert one.keys() == two.keys() >= {"displacement", "velocity", "intact_bonds", "work", "released", "ball_impulse"}
    for name, values in one.items():
        assert (two[name] == values).all(), name
    for file in ("frames.vtkhdf", "bodies.vtkhdf"):
        frames, other_frames = datasets(ball / file), datasets(tmp_path / file)
        assert frames.keys() == other_frames.keys() >= {"VTKHDF/Points", "VTKHDF/Polygons/Connectivity"}
        for name, values in frames.items():
            np.testing.assert_array_equal(other_frames[name], values, err_msg=name)
    assert history.read_text() == (ball / "history.csv").read_text()
    assert len(history.read_text().splitlines()) == 26


def test_a_run_whose_frames_are_gone_is_not_resumed(ball, tmp_path):
    folder = tmp_path / "gone"
    shutil.copytree(ball, folder)
    (folder / "frames.vtkhdf").unlink()
    done = cli("run", *BALL, "--frames", "24", "--no-pictures", "--resume", "--out", folder)
    assert done.exit_code == 2
    assert "still has its frames.vtkhdf" in done.output


@pytest.mark.parametrize("content", [b"", b"not a zip", None])
def test_a_damaged_restart_file_is_named(ball, tmp_path, content):
    complete = (ball / "restart.npz").read_bytes()
    (tmp_path / "restart.npz").write_bytes(complete[: len(complete) // 2] if content is None else content)
    done = cli("run", *BALL, "--frames", "24", "--resume", "--out", tmp_path)
    assert done.exit_code == 2
    assert "restart.npz" in done.output and "damaged" in done.output


def test_a_restart_file_of_other_settings_is_refused(ball, tmp_path):
    shutil.copy(ball / "restart.npz", tmp_path / "restart.npz")
    done = cli("run", *BALL, "--frames", "24", "--set", "damping=1", "--resume", "--out", tmp_path)
    assert done.exit_code == 2 and "different settings (damping = 0.0, here 1.0)" in done.output
    done = cli("run", *BALL, "--frames", "12", "--precision", "64", "--resume", "--out", tmp_path)
    assert done.exit_code == 2 and "different settings (frames = 24, here 12; precision = 32, here 64)" in done.output
    done = cli("run", *BALL, "--resume", "--out", tmp_path / "new")
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
    command = ["run", tmp_path / "mine.py", "--device", "cpu", "--quiet", "--no-usd", "--out", tmp_path / "out"]
    assert cli(*command).exit_code == 0
    assert cli(*command, "--resume").exit_code == 0
    done = cli(*command, "--resume", "--set", "at=100")
    assert done.exit_code == 2 and "different settings (at = 10, here 100)" in done.output


def simulation(points=7, density=1000.0, **changes):
    sheet = square(points, density=density)
    given = {"force": BondAssociated(NEO), "solver": Explicit(1e-3, frames=4), **changes}
    return Simulation(sheet, loads=[Fixed(sheet.edges()), Pressure(2.0)], **given)


SMALL_MOVE = np.full((49, 3), 1e-6)
OTHER = {
    "density": ({"density": 900.0}, "sheet.density = 1000.0, here 900.0"),
    "horizon": ({"force": BondAssociated(NEO, horizon=1.5)}, "force.horizon = 2.015, here 1.5"),
    "solver": ({"solver": Newton()}, "precision = 32, here 64; solver = Explicit, here Newton"),
    "damage": ({"damage": CriticalStretch(2.0)}, "damage = None, here CriticalStretch"),
    "points": ({"points": 9}, "sheet.points = array (49, 2)"),
    "energy": ({"track_energy": False}, "track_energy = True, here False"),
    "initial displacement": ({"initial_displacement": SMALL_MOVE}, "initial_displacement = None, here array (49, 3)"),
    "initial velocity": ({"initial_velocity": SMALL_MOVE}, "initial_velocity = None, here array (49, 3)"),
}


@pytest.mark.parametrize("name", OTHER)
def test_what_differs_from_a_restart_file_is_named_without_a_scene(name, tmp_path):
    other, said = OTHER[name]
    options = {"out": tmp_path, "device": "cpu", "usd": False}
    assert simulation().run(**options, writers=[StopAt(3)]).status == "interrupted"
    before = {path.name: path.read_bytes() for path in tmp_path.iterdir()}
    with pytest.raises(InputError, match="different settings") as refused:
        simulation(**other).run(**options, resume=True)
    assert said in str(refused.value) and "\n" not in str(refused.value)
    # Nothing has happened to the run, which can still go on.
    assert {path.name: path.read_bytes() for path in tmp_path.iterdir()} == before
    assert simulation().run(**options, resume=True).status == "finished"


def test_an_initial_state_of_other_numbers_is_refused(tmp_path):
    """Of the same shape and type, and equal but for one number."""
    first, other = SMALL_MOVE.copy(), SMALL_MOVE.copy()
    other[17, 1] *= 1.0 + 1e-12
    options = {"out": tmp_path, "device": "cpu", "usd": False}
    assert simulation(initial_velocity=first).run(**options, writers=[StopAt(3)]).status == "interrupted"
    with refused(match=r"different settings .initial_velocity = array"):
        simulation(initial_velocity=other).run(**options, resume=True)
    assert simulation(initial_velocity=first).run(**options, resume=True).status == "finished"


def test_damaged_frames_are_refused_in_one_line(tmp_path):
    """Neither a traceback nor a new file in their place."""
    name = "frames.vtkhdf"
    command = ["run", "ball_penetration", "--points", "11", "--duration", "0.1", "--frames", "3", "--out", tmp_path]
    assert cli(*command, "--no-pictures").exit_code == 0
    (tmp_path / name).write_bytes(b"x")
    done = cli(*command, "--no-pictures", "--resume", "--quiet")
    assert done.exit_code == 2 and name in done.output and "expected a" in done.output
    assert len(done.output.strip().splitlines()) == 1
    assert (tmp_path / name).read_bytes() == b"x"


def test_a_finished_run_goes_on_for_longer(tmp_path):
    """With more frames at the same interval it is the longer run, bit for bit; anything else is refused."""

    def scene(duration, frames):
        sheet = square(9)
        loads = [Fixed(sheet.edges("left")), Pressure(5.0)]
        solver = Explicit(duration, frames=frames, damping=1.0)
        return Simulation(sheet, BondAssociated(NEO), solver, loads, damage=TearingEnergy(5.0))

    options = {"device": "cpu", "out": tmp_path / "run"}
    assert scene(0.02, 4).run(**options).status == "finished"
    for duration, frames in ((0.03, 4), (0.03, 5), (0.01, 2)):
        with refused(match=r"different settings \(solver\.(duration = .* a longer duration with|frames = )"):
            scene(duration, frames).run(**options, resume=True)
    longer = scene(0.03, 6).run(**options, resume=True)
    whole = scene(0.03, 6).run(device="cpu", out=tmp_path / "whole")
    assert longer.history == whole.history and len(whole.history) == 7
    np.testing.assert_array_equal(longer.frame.displacement, whole.frame.displacement)
    frames, others = datasets(tmp_path / "run" / "frames.vtkhdf"), datasets(tmp_path / "whole" / "frames.vtkhdf")
    for name, values in others.items():
        np.testing.assert_array_equal(frames[name], values, err_msg=name)
