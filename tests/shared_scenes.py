"""Small scenes that one process and several run alike, and the processes that run them.

`python -m torch.distributed.run --standalone --nproc-per-node N tests/shared_scenes.py DEVICE FOLDER NAME...` runs
scenes into FOLDER/NAME.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np

from warp_pd import (
    BodyForce,
    BodyPath,
    BondAssociated,
    CriticalEnergy,
    CriticalStretch,
    Explicit,
    Fixed,
    Measure,
    MooneyRivlin,
    Motion,
    PointForce,
    Pressure,
    Prony,
    Relaxation,
    RigidBall,
    RigidBody,
    Sheet,
    Simulation,
    Sphere,
    TearingEnergy,
    TensionField,
    Visco,
    Yeoh,
)
from warp_pd.device import launches
from warp_pd.device.fields import to_host
from warp_pd.device.launches import Call, Touched
from warp_pd.distributed.divided import DividedSheet
from warp_pd.run.built import compose, partition_of

MATERIAL, STIFFENING = MooneyRivlin(5e4, 0.0), Yeoh(5e4, 5e3)
SIZE = {"thickness": 1e-3, "density": 1000.0}
DURATION = 4e-2
# Points along a side, and those of a lattice whose undamaged families have a kernel of their own on a GPU.
POINTS, LARGE = 33, 161
# Name of each scene, its precision.
SCENES = {
    "loads": 32,
    "pulled": 64,
    "torn": 32,
    "wide": 32,
    "cloud": 32,
    "scattered": 64,
    "hole": 32,
    "tube": 32,
    "energy": 32,
    "visco": 32,
    "field": 32,
    "field cloud": 64,
    "field hole": 32,
    "field relaxed": 64,
    "field large": 32,
    "body": 32,
    "relaxed": 64,
    "taut": 64,
}


def thick(x, y):
    return 1e-3 * (1.0 + 0.5 * x * y)


def sheet_of(name, points):
    # The sweeps of a field go further than a halo: twice as long a sheet is not all within their reach.
    height, grid = (2.0, (points, 2 * points - 1)) if name.startswith("field") else (1.0, points)
    size = {**SIZE, "thickness": thick} if name in ("cloud", "field hole") else SIZE
    if name in ("cloud", "field cloud"):
        sheet = Sheet.filled(1.0, height, points=grid, jitter=0.2, **size)
    elif name == "scattered":
        places = Sheet.filled(1.0, 1.0, points=points, jitter=0.2, **SIZE).points
        sheet = Sheet.from_points(np.random.default_rng(1).permutation(places), **SIZE)
    elif name == "tube":
        sheet = Sheet.tube(0.3, 1.0, points=(40, 22), **SIZE)
    else:
        sheet = Sheet.rectangle(1.0, height, points=grid, **size)
    if name in ("hole", "field hole"):
        sheet = sheet.hole((0.5, 0.5), 0.15)
    if name.startswith("field"):
        sheet = sheet.cut((0.81, -0.01), (0.81, 0.9))
    if name == "torn":
        sheet = sheet.cut((0.0, 0.49), (0.3, 0.49)).stiffened(sheet.within((0.7, 0.7), 0.1), 2.0)
    return sheet


def law_of(name):
    horizon = {"wide": 3.15, "field hole": 3.15, "loads": 1.5}.get(name, 2.015)
    if name == "visco":
        return Visco(MATERIAL, horizon=horizon, prony=(Prony(3e4, 0.02),))
    if name == "energy":
        return BondAssociated(MATERIAL, horizon=horizon, weights="plain", fast=False)
    if name == "taut":
        return BondAssociated(TensionField(MATERIAL), horizon=horizon)
    return BondAssociated(STIFFENING if name == "field hole" else MATERIAL, horizon=horizon)


def damage_of(name, clamp):
    if name in ("torn", "tube", "wide", "visco", "body", "cloud"):
        return CriticalStretch(1.3, spared=clamp)
    if name.startswith("field"):
        # Less strength than a length stands for; more sweeps than there are layers of ghost points.
        other = {"field cloud": {"length": 0.13, "strength": 1500.0}, "field hole": {"length": 0.2}}
        energy = (lambda x, y: 2000.0 + 500.0 * y) if name == "field hole" else 2000.0
        return TearingEnergy(energy, spared=clamp, **other.get(name, {}))
    return CriticalEnergy(500.0) if name == "energy" else None


def scene(name, points=None, frames=2, duration=None):
    """A sheet that is pulled, in many variants."""
    large = name.endswith("large")
    points, duration = points or (LARGE if large else POINTS), duration or (3.0 if large else 1.0) * DURATION
    sheet = sheet_of(name, points)
    low, high = (
        sheet.edges(*(("bottom",) if name == "tube" else ("left",))),
        sheet.edges(*(("top",) if name == "tube" else ("right",))),
    )
    path = [0.0, 0.3]
    pull = Motion(high, [0.0, duration], **({"z": path} if name == "tube" else {"x": path, "y": 0.0}))
    # Where a crack takes pressure from triangles, too.
    on = "triangles" if name in ("torn", "cloud", "field hole") else "points"
    loads = [Fixed(low), pull, Pressure(30.0, on=on)]
    contact = None
    if name == "loads":
        middle = sheet.within((0.5, 0.5), 0.1)
        loads += [BodyForce((0.0, 0.0, -9810.0), ramp=[(0.0, 0.0), (duration, 1.0)]), PointForce(middle, (0, 0, 0.2))]
        contact = RigidBall(0.3, (0.5, 0.5, 0.16), (0.0, 0.0, -0.3))
    if name == "body":
        way = BodyPath([0.0, duration], [(0.5, 0.5, 0.16), (0.52, 0.5, 0.0)])
        contact = RigidBody(Sphere(0.15), way, friction=0.3)
    frames *= 3 if name == "field" else 1
    solver = Explicit(duration, frames=frames, damping=2.0, history_every=duration / 9 if name == "cloud" else None)
    if name == "field relaxed":
        # Six rounds of rupture.
        loads = [Fixed(low), Motion(high, [0.0, 1.0], x=[0.0, 0.09], y=0.0, z=0.0)]
        solver = Relaxation(load_steps=1, tolerance=1e-3)
    if name in ("relaxed", "scattered"):
        loads = [Fixed(low), Motion(high, [0.0, 1.0], x=[0.0, 0.1], y=0.0, z=0.0)]
        solver = Relaxation(load_steps=1)
    if name == "taut":
        # Slack at first: it stiffens faster than the estimate of the step follows, and frames are repeated.
        loads, solver = [Fixed(sheet.edges("all")), Pressure(100.0)], Explicit(0.2, frames=6, safety=0.9)
    pulled = Measure("pull", "N", lambda built, frame: -built.to_numpy(built.state.force)[high, 0].sum())
    return Simulation(
        sheet, law_of(name), solver, loads=loads, damage=damage_of(name, low), contact=contact, measures=[pulled]
    )


def build(name="torn", points=33, frames=2, duration=DURATION):
    """For `warp-pd run`."""
    return scene(name, points, frames, duration)


class OneOfMany(DividedSheet):
    """One of several processes, whose calls to the others do nothing."""

    def __init__(self, made, rank, size):
        self.rank, self.size = rank, size
        self.set_partition(partition_of(made, self))

    def exchange(self, fields, partition):
        names = ", ".join(stored.name for stored in fields)
        return Call(f"exchange {names}", "", 0, lambda: None, None, Touched())

    def gather_field(self, stored, index, partition, coarse):
        return to_host(stored.array)

    def gather_to_blocks(self, pairs, partition):
        return Call("gather to blocks", "", 0, lambda: None, None, Touched())

    def gather_blocks(self, mine, everything, partition):
        return Call("gather blocks", "", 0, lambda: None, None, Touched())


def composed(made, rank=0, size=2, precision=None):
    """A scene as one of several processes builds it."""
    return compose(made, "cpu", precision, OneOfMany(made, rank, size))


def started(processes, *arguments):
    """Python with some arguments in several processes of torchrun; the finished one."""
    # By itself torchrun takes a fixed port, which another run may have.
    command = [sys.executable, "-m", "torch.distributed.run", "--standalone", "--nproc-per-node", str(processes)]
    command += map(str, arguments)
    environment = {**os.environ, "OMP_NUM_THREADS": "1"}
    return subprocess.run(command, capture_output=True, text=True, check=False, env=environment, timeout=300)


def run_all(device, folder, names):
    """Run scenes into a folder of their own each; frames of one have every fifth column and row."""
    for name in names:
        options = {
            "precision": SCENES[name],
            "usd": False,
            "pictures": False,
            "overwrite": True,
            "stride": 5 if name == "torn" else 1,
        }
        scene(name).run(device=device, out=folder / name, **options)


def arrays_of(folder):
    """What a run left in its folder: arrays of the restart file, the histories as text, bytes of frames."""
    with np.load(folder / "restart.npz") as stored:
        arrays = {name: stored[name] for name in stored.files if name != "numbers"}
    rows = [(folder / name).read_text() for name in ("history.csv", "fine_history.csv") if (folder / name).exists()]
    return arrays, "".join(rows), (folder / "frames.vtkhdf").stat().st_size


if __name__ == "__main__":
    if sys.argv[1] == "cpu":
        # As in the tests that start it (tests/conftest.py): they share what they compile.
        launches._joined = lambda first, second: None
    run_all(sys.argv[1], Path(sys.argv[2]), sys.argv[3:])
