"""What the files of a run hold: chosen fields, chosen formats, and what is refused."""

import json

import numpy as np
import pytest
import warp as wp
from helpers import refused, square
from small_runs import BALL, cli, simulate

from warp_pd import BondBased, CriticalStretch, Explicit, Fixed, Frames, Simulation
from warp_pd.interfaces import BuiltPart, Part
from warp_pd.papers.bond_based import Bimodular

SHORT = (*BALL, "--duration", "0.05", "--frames", "2", "--no-usd")


def small(**parts):
    sheet = square(9)
    return simulate(sheet, Explicit(0.01, frames=2), loads=[Fixed(sheet.edges("left"))], **parts)


def held(folder):
    return set(Frames(folder).fields)


def test_files_hold_the_chosen_fields_and_the_displacement(tmp_path):
    simulation = small(damage=CriticalStretch(2.0), fields=("bonds",))
    for number, (fields, expected) in enumerate(
        [
            (None, {"displacement", "velocity", "damage", "strain_energy_density", "intact_bonds", "broken_bonds"}),
            ((), {"displacement", "intact_bonds", "broken_bonds"}),
            (("damage", "stretch"), {"displacement", "damage", "stretch_1", "stretch_2", "intact_bonds",
                                     "broken_bonds"}),
            (("stretch_1",), {"displacement", "stretch_1", "intact_bonds", "broken_bonds"}),
        ]
    ):  # fmt: skip
        result = simulation.run(device="cpu", out=tmp_path / str(number), usd=False, fields=fields)
        assert held(result.folder) == expected
        # Measures see all that there is.
        assert result.frame.damage is not None and np.isfinite(result.frame.velocity).all()
    assert simulation.chosen_fields is None


def test_choices_change_no_bit_of_the_run(tmp_path):
    plain, chosen = (small().run(device="cpu", fields=fields) for fields in (None, ("stretch", "cauchy")))
    assert plain.frame.displacement.tobytes() == chosen.frame.displacement.tobytes()
    assert plain.history == chosen.history


def test_the_command_line_chooses(tmp_path):
    done = cli("run", *SHORT, "--no-pictures", "--fields", "damage, stretch", "--out", tmp_path / "a")
    assert done.exit_code == 0, done.output
    assert held(tmp_path / "a") == {"displacement", "damage", "stretch_1", "stretch_2"}
    done = cli("run", *SHORT, "--no-vtkhdf", "--out", tmp_path / "b")
    assert done.exit_code == 0, done.output
    assert {path.name for path in (tmp_path / "b").iterdir()} == {"history.csv", "restart.npz", "summary.json"}


def test_pictures_of_fields_that_were_left_out_become_a_note(tmp_path):
    done = cli("run", *SHORT, "--fields", "stretch", "--out", tmp_path / "a")
    assert done.exit_code == 0, done.output
    notes = json.loads((tmp_path / "a" / "summary.json").read_text())["notes"]
    assert any("field 'damage': the frames hold" in note for note in notes)


@pytest.mark.parametrize(
    ("fields", "said"),
    [
        ("strech", "did you mean 'stretch'"),
        ("temperature", "fields = 'temperature': expected one of 'displacement', 'velocity', 'damage'"),
        ("damage", "fields = 'damage': the frames of this scene have no such field; expected one of bonds, cauchy"),
    ],
)
def test_unknown_fields_are_refused_with_those_that_there_are(fields, said, tmp_path):
    done = cli("run", "pressure", "--points", "11", "--fields", fields, "--out", tmp_path / "a")
    assert done.exit_code == 2 and said in done.output and done.output.count("\n") == 1
    assert not (tmp_path / "a" / "summary.json").exists()


class Marked(Part):
    """A part with a field of its own."""

    def build(self, context, law):
        context.array("mark", "Marked", wp.float32, np.arange(context.sheet.size), output="mark")
        return BuiltMark()


class BuiltMark(BuiltPart):
    label = "Marked"


@pytest.mark.parametrize("fields", [("mark",), ("mark", "stretch")])
def test_fields_of_a_part_can_be_chosen(fields, tmp_path):
    sheet = square(9)
    simulation = simulate(sheet, Explicit(0.01, frames=2), loads=[Marked()])
    result = simulation.run(device="cpu", out=tmp_path / "a", usd=False, fields=fields)
    arrays = {"mark": {"mark"}, "stretch": {"stretch_1", "stretch_2"}}
    assert held(result.folder) == {"displacement"}.union(*(arrays[name] for name in fields))
    assert (result.frame.point_data["mark"] == np.arange(sheet.size)).all()
    with refused(match=r"expected one of .*'mark'.*did you mean 'mark'"):
        simulation.run(device="cpu", out=tmp_path / "b", usd=False, fields=["marc"])


def test_a_law_says_what_it_gives():
    with refused(match="the law BondBased has no such field; expected one of principal_stress"):
        Simulation(square(9), BondBased(Bimodular(1e4)), Explicit(1.0), chosen_fields=["cauchy"]).build("cpu")
    with refused(match="fields = 'damage': expected a list of names"):
        small().run(device="cpu", fields="damage")


def test_a_run_is_resumed_with_the_files_it_began_with(tmp_path):
    fields = ["--fields", "stretch", "--no-pictures"]
    assert cli("run", *SHORT, *fields, "--out", tmp_path / "a").exit_code == 0
    done = cli("run", *SHORT, "--no-pictures", "--resume", "--out", tmp_path / "a")
    assert done.exit_code == 2 and "chosen_fields" in done.output
    longer = (*BALL, "--duration", "0.1", "--frames", "4", "--no-usd")
    done = cli("run", *longer, *fields, "--resume", "--out", tmp_path / "a")
    assert done.exit_code == 0, done.output
    assert len(Frames(tmp_path / "a")) == 5
