"""The plan: arrays and launches, without those that a scene does not use."""

import re

import pytest
from helpers import NEO, square
from small_runs import cli

from warp_pd import BondAssociated, CriticalStretch, Explicit, Fixed, Implicit, Newton, Pressure, RigidBall, Simulation
from warp_pd.command import trial
from warp_pd.output.progress import Progress
from warp_pd.run import recorder


def column(table, name):
    """A column of a table, by the name in its header."""
    header, *rows = [re.split(r" {2,}", line) for line in table.splitlines() if line.startswith("  ")]
    return [row[header.index(name)] for row in rows]


def names_of(plan):
    """Names of all arrays, and of all kernels and pointwise stages."""
    arrays, launches = plan.split("\nlaunches\n")
    kernels = [part for name in column(launches, "kernel") for part in name.split(", ")]
    return {*column(arrays, "name"), *kernels}


def test_the_plan_leaves_out_what_a_scene_does_not_use():
    sheet = square(9)
    law = BondAssociated(NEO, weights="plain")
    bare = names_of(Simulation(sheet, law, Explicit(1.0)).plan("cpu"))
    absent = {"intact_bonds", "damage", "released", "held", "external", "work", "dissipated", "damping", "ball_impulse", "ball_reference",  # noqa: E501
              "time", "scheduled", "tick", "prescribe", "strike_points", "follow_path", "break_bonds", "begin_loads"}  # fmt: skip  # noqa: E501
    assert not bare & absent
    assert {"displacement", "velocity", "force", "mass", "drift", "kick"} <= bare
    full = names_of(
        Simulation(
            sheet, law, Explicit(1.0, damping=1.0), damage=CriticalStretch(2.0), contact=RigidBall(0.1, (0, 0, 1)),
            loads=[Fixed(sheet.edges()), Pressure(1.0, ramp=[(0, 0), (1, 1)])],
        ).plan("cpu")
    )  # fmt: skip
    assert full >= absent - {"prescribe"}


def test_the_plan_counts_bytes():
    done = cli("plan", "ball_penetration", "--points", "21", "--set", "critical_stretch=1.3", "--device", "cpu")
    assert done.exit_code == 0, done.output
    arrays, launches = done.output.split("\nlaunches\n")
    table, total = arrays.rstrip().rsplit("\n", 1)
    found = re.fullmatch(r"  (\d+) bytes, (\d+\.\d) per point", total)
    bytes_of_arrays = sum(map(int, column(table, "bytes")))
    assert int(found[1]) == bytes_of_arrays > 0
    assert float(found[2]) == pytest.approx(bytes_of_arrays / 841, abs=0.05)
    # Three numbers of four bytes.
    assert dict(zip(column(table, "name"), column(table, "bytes"), strict=True))["displacement"] == str(12 * 841)
    assert "break_bonds" in column(launches, "kernel")


@pytest.mark.parametrize(
    ("solver", "told"),
    [
        (Explicit(0.5, frames=2), r"step \S+ s, about \d+ steps for 0.5 s, about .+ on this machine, \S+ MB"),
        (Explicit(400.0, frames=2), r"steps of \S+ s follow waves, .*: Implicit\(400, tolerance=1e-4\) follows"),
        (Implicit(0.1, frames=1, steps=10), r"step 0.01 s, about 10 steps for 0.1 s, about .+, \S+ MB$"),
        (Implicit(1.0, tolerance=1e-3), r"step \S+ s at first, then as the tolerance allows"),
        (Implicit(0.01, frames=1, steps=10), r"shorter than a wave takes .*, \S+ s: Explicit is faster"),
        (Newton(), r"^$"),
    ],
)  # fmt: skip
def test_a_plan_tells_how_long_a_run_takes_and_what_is_faster(solver, told, monkeypatch):
    monkeypatch.setattr(trial, "TIMED", 0.01)
    sheet = square(7)
    law = BondAssociated(NEO, horizon=2.015, weights="plain")
    simulation = Simulation(sheet, law, solver, loads=[Fixed(sheet.edges("left"))])
    assert re.search(told, trial.foretold(simulation.build("cpu")), re.MULTILINE)


def test_a_run_tells_how_long_it_takes(monkeypatch, capsys):
    """Not for steps that adapt, nor for load steps."""
    monkeypatch.setattr(recorder, "TIMED", 0.01)
    sheet = square(7)
    law = BondAssociated(NEO, horizon=2.015, weights="plain")
    told = []
    for solver in (Explicit(0.5), Implicit(1.0, steps=100), Implicit(1.0, tolerance=1e-3), Newton(load_steps=9)):
        Simulation(sheet, law, solver, loads=[Fixed(sheet.edges("left"))]).run(device="cpu", reporter=Progress())
        told.append(len(re.findall(r"^about .+ to go on this machine$", capsys.readouterr().err, re.MULTILINE)))
    assert told == [1, 1, 0, 0]
