"""The benchmark times what it says: the right case, at both ends of a broken bond, in any feature."""

import numpy as np
import pytest
from click.testing import CliRunner
from helpers import refused

from warp_pd.__main__ import main
from warp_pd.command.bench import FEATURES, Case, Timing, break_some, measure, table, time_step
from warp_pd.families import unpack


@pytest.mark.parametrize("layout", ["lattice", "hole", "cloud"])
def test_bonds_are_broken_at_both_ends(layout):
    case = Case(15, 2.015, 64, features=("rupture",), layout=layout, damaged=0.3)
    built = case.simulation().build("cpu", 64)
    families = built.law.families
    before = unpack(built.law.intact.numpy().T.copy(), families.members)
    break_some(built, case.damaged)
    after = unpack(built.law.intact.numpy().T.copy(), families.members)
    lost = before & ~after
    assert 0.15 < lost.any(axis=1).mean() < 0.45
    tail, member = np.nonzero(lost)
    head, reverse = families.heads(tail, member), families.reverse_members(tail, member)
    assert lost[head, reverse].all()


def test_a_measured_sheet_stays_as_it_is_and_the_table_has_its_numbers():
    case = Case(15, 2.015, 64, features=FEATURES)
    built = case.simulation().build("cpu", 64)
    before = built.to_numpy(built.state.displacement)
    step, spread = time_step(built, seconds=0.05, repeats=4)
    assert np.ptp(before, axis=0).min() > 0.01
    assert built.to_numpy(built.state.displacement) == pytest.approx(before, abs=1e-6 * case.simulation().sheet.spacing)
    assert step > 0.0 and spread >= 0.0
    timing = measure(case, "cpu", seconds=0.05, repeats=4)
    assert timing.points == 225
    assert timing.bonds == built.law.families.bond_count
    assert timing.step > 0.0
    assert timing.bond_steps > 8 * timing.point_steps
    lines = table([timing]).splitlines()
    assert len(lines) == 3
    assert lines[0].count("|") == lines[1].count("|") == lines[2].count("|")
    assert "supports, pressure, contact, rupture, energy, damping" in lines[2]


def test_rates_are_points_and_bonds_over_the_time_of_a_step():
    timing = Timing(
        Case(15, 2.015), points=225, bonds=2500, step=0.5, spread=0.0, array_bytes=1, setup=0.0, compile=0.0
    )  # fmt: skip
    assert (timing.point_steps, timing.bond_steps) == (450.0, 5000.0)


def test_a_tube_has_the_bonds_of_its_square_and_more_across_the_seam():
    square, tube = (Case(15, 2.015, 64, layout=layout).simulation().build("cpu", 64) for layout in ("cloud", "tube"))
    # In each row one bond of a spacing and two of two, between rows two diagonals; each counted from both ends.
    seam = 2 * (15 + 2 * 15 + 2 * 14)
    assert tube.law.families.bond_count == square.law.families.bond_count + seam


def test_a_feature_that_is_left_out_takes_no_bytes():
    bare, torn = (Case(15, 1.5, 64, features=f).simulation().build("cpu", 64) for f in ((), ("rupture",)))
    assert bare.context.fields.nbytes < torn.context.fields.nbytes
    assert len(bare.context.stages["step"]) < len(torn.context.stages["step"])


@pytest.mark.parametrize(
    ("values", "message"),
    [
        ({"features": ("fire",)}, "features = 'fire'"),
        ({"layout": "mesh"}, "layout = 'mesh'"),
        ({"damaged": 0.1}, r"damaged = 0\.1"),
        ({"damaged": 2.0, "features": ("rupture",)}, r"damaged = 2\.0"),
        ({"damaged": float("nan")}, "damaged = nan"),
    ],
)
def test_wrong_cases(values, message):
    with refused(match=message):
        Case(15, 2.015, **values)


def test_the_command_prints_a_table():
    arguments = ["bench", "--points", "11", "--horizon", "1.5", "--seconds", "0.02", "--device", "cpu"]
    done = CliRunner().invoke(main, arguments)
    assert done.exit_code == 0
    assert "| 121 | bond_associated | lattice | 1.5 | 32 | none |" in done.output


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        (["--points", "2"], "points = 2"),
        (["--precision", "16"], "precision = 16"),
        (["--seconds", "0"], "seconds = 0"),
    ],
)
def test_wrong_arguments_of_the_command(arguments, message):
    done = CliRunner().invoke(main, ["bench", "--device", "cpu", *arguments])
    assert done.exit_code == 2
    assert message in done.output
