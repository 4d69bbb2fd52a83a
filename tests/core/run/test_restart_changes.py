"""Changes between a run and its resumption, of what is no part of the state: refused in one line, or done right."""

import pytest
from helpers import NEO, StopAt, square
from point_laws import tiny

from warp_pd import BondAssociated, Explicit, Fixed, InputError, Measure, Neural, Pressure, Simulation
from warp_pd.run.folder import read_history


def simulation(**changes):
    sheet = square(7)
    given = {"force": BondAssociated(NEO), "solver": Explicit(1e-3, frames=4), **changes}
    return Simulation(sheet, loads=[Fixed(sheet.edges()), Pressure(2.0)], **given)


def stopped_and_resumed(folder, began, goes_on, **changed):
    """The result of a resumed run, or None if it was refused in one line."""
    options = {"out": folder, "device": "cpu", "usd": False}
    assert began.run(**options, writers=[StopAt(3)]).status == "interrupted"
    try:
        return goes_on.run(**{**options, **changed}, resume=True)
    except InputError as refused:
        assert "\n" not in str(refused)
        return None


def measure(name):
    return Measure(name, "m", lambda built, frame: float(frame.displacement[:, 2].max()))


CHANGED = {"added": ([], ["a"]), "removed": (["a"], []), "renamed": (["a"], ["b"]), "one more": (["a"], ["a", "b"])}


@pytest.mark.parametrize("change", CHANGED)
def test_other_measures_leave_a_history_with_every_number(change, tmp_path):
    began, goes_on = (simulation(measures=[measure(name) for name in names]) for names in CHANGED[change])
    result = stopped_and_resumed(tmp_path, began, goes_on)
    history = read_history(tmp_path / "history.csv")
    if result is not None:
        assert result.status == "finished" and len(history) == 5
        assert all(row.keys() == history[0].keys() for row in history)
        assert {m.name for m in goes_on.measures} <= history[-1].keys()
    else:
        again = simulation(measures=began.measures).run(out=tmp_path, device="cpu", usd=False, resume=True)
        assert again.status == "finished"


def test_a_network_of_other_weights_is_refused():
    """Also a user's module, whose text has only the shapes of its layers."""
    torch = pytest.importorskip("torch")
    from warp_pd.run.restart import identity

    def layer(bias):
        made = torch.nn.Linear(4, 2)
        torch.nn.init.zeros_(made.weight)
        torch.nn.init.constant_(made.bias, bias)
        return made

    def known(network):
        scene = simulation(force=Neural(NEO, network=network))
        return identity(scene, scene.build("cpu"))

    for network in (layer, tiny):
        assert known(network(0)) == known(network(0)) != known(network(1))
