"""The summary: measures and outcomes, and those that fail."""

import json

import pytest
from helpers import NEO, square

from warp_pd import BondAssociated, Explicit, InputError, Measure, Outcome, Simulation


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
    with pytest.raises(InputError, match="Measure 'm' gives 'abc': expected a number"):
        one_frame(tmp_path, measures=[Measure("m", "1", lambda built, frame: "abc")])
    with pytest.raises(InputError, match="pictures: KeyError"):
        one_frame(tmp_path, pictures=lambda history, folder: history[0]["nothing"])
    assert (tmp_path / "summary.json").is_file()
