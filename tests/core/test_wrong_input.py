"""Wrong input is one line that names the argument, its value and what is expected."""

import numpy as np
import pytest
from helpers import NEO, refused, square

from warp_pd import (
    ArcLength,
    BodyForce,
    BondAssociated,
    CriticalStretch,
    Explicit,
    Fixed,
    InputError,
    Newton,
    Relaxation,
    RigidBall,
    Sheet,
    Simulation,
)
from warp_pd.device.checks import show, suggestion

FLAT = {"thickness": 1e-3, "density": 1000.0}


def simulated(**parts):
    values = {"force": BondAssociated(NEO), "solver": Explicit(0.01, frames=1), **parts}
    return Simulation(values.pop("sheet", square(9)), **values)


WRONG = {
    "layers": (lambda: Sheet.rectangle(1.0, 1.0, layers=3, **FLAT), "layers = 3: expected two whole numbers"),
    "ragged points": (lambda: Sheet.from_points([[0, 0], [1]], **FLAT), "points = [[0, 0], [1]]: expected numbers"),
    "triangles": (
        lambda: Sheet.from_points(square(3).points, triangles=[[0.5, 1.0, 2.0]], **FLAT),
        "triangles = array([[0.5, 1. , 2. ]]): expected whole numbers of shape (F, 3) with F >= 1",
    ),
    "corner": (
        lambda: Sheet.from_points(square(3).points, triangles=[[0, 1, 99]], **FLAT),
        "triangles contains point 99: expected 0 to 8",
    ),
    "uneven spacings": (
        lambda: simulated(sheet=Sheet.rectangle(0.1, 0.1, points=(41, 11), **FLAT)).build("cpu"),
        "horizon = 2.015: expected at least 2.07 on a lattice, so that families contain their diagonal neighbours, or "
        "spacings more alike than 0.0025 and 0.01 m",
    ),
    "out": (lambda: simulated().run(device="cpu", out=3), "out = 3: expected a folder or None"),
    "writers": (
        lambda: simulated().run(device="cpu", writers=[3]),
        "writers[0] = 3: expected a Writer with the methods write, save and close",
    ),
    "mask": (
        lambda: simulated(loads=[Fixed(np.zeros(121, bool))]).build("cpu"),
        "Fixed.points = bool array of shape (121,): expected point indices, or a mask of 81 booleans",
    ),
    "components": (lambda: Fixed([0], "xx"), "Fixed.components = 'xx': expected distinct letters from 'xyz'"),
    "fields": (lambda: simulated(fields="damage").build("cpu"), "fields = 'damage': expected a list of names"),
    "ArcLength": (
        lambda: ArcLength(increment=1.5),
        "increment = 1.5: expected a number greater than 0 and less than 1",
    ),
    "a path with rupture": (
        lambda: simulated(solver=ArcLength(), damage=CriticalStretch(1.5)).build("cpu"),
        "damage = CriticalStretch: expected TearingEnergy with ArcLength, or the solver Newton",
    ),
    "Newton": (lambda: Newton(tolerance=1.0), "tolerance = 1.0: expected a number greater than 0 and less than 1"),
    "Relaxation": (lambda: Relaxation(tolerance=2), "tolerance = 2: expected a number greater than 0 and less than 1"),
    "small ball": (
        lambda: simulated(contact=RigidBall(0.017, (0.05, 0.05, 0.1))).build("cpu"),
        "RigidBall.diameter = 0.017: expected at least 1.42 spacings, 0.0177 m; use more points",
    ),
    "ball in the sheet": (
        lambda: simulated(contact=RigidBall(0.06, (0.05, 0.05, 0.01))).build("cpu"),
        "RigidBall: expected a body outside the sheet at the start; point 40 is 0.02 m inside it",
    ),
}


@pytest.mark.parametrize("name", WRONG)
def test_it_is_one_line(name):
    make, text = WRONG[name]
    with pytest.raises(InputError) as caught:
        make()
    assert str(caught.value) == text


def test_a_ball_may_touch_the_sheet_at_the_start():
    assert simulated(contact=RigidBall(0.06, (0.05, 0.05, 0.03))).build("cpu").contact is not None


def test_values_in_messages_are_short():
    assert show(np.zeros((3, 200))) == "float64 array of shape (3, 200)"
    assert show(int) == "the class int" and show(lambda x: x) == "the function <lambda>"
    assert len(show("x" * 1000)) == 90 and "\n" not in show([np.zeros(5), "a\nb"])


def test_much_damping_shortens_the_step():
    """A step in which damping takes more than the velocity turned it round, and the balance was off by -95 %."""
    sheet = square(9)
    loads = [Fixed(sheet.edges("left")), BodyForce((0.0, 0.0, -9.81))]
    result = simulated(sheet=sheet, loads=loads, solver=Explicit(0.01, frames=2, damping=1e5)).run(device="cpu")
    assert result.status == "finished" and result.summary["dt"] <= 0.2 / 1e5
    assert abs(result.history[-1]["balance_error"]) < 1e-3


def test_a_balance_that_is_off_is_a_note():
    from warp_pd.run.result import _energy_notes

    row = {"kinetic": 1.0, "strain": 1.0, "rupture": 0.0, "balance_error": 0.0}
    history = [row, {**row, "rupture": 0.5, "balance_error": -0.03}, {**row, "rupture": 0.4}]
    built = simulated(sheet=square(5)).build("cpu")
    notes = _energy_notes(type("Recorder", (), {"history": history, "built": built}))
    assert notes == [
        "energy: the balance is off by -3 %; try smaller steps",
        "energy: breaking bonds added 0.1 J between two frames; expected only losses",
    ]
    assert not _energy_notes(type("Recorder", (), {"history": [row, row], "built": built}))


@pytest.mark.parametrize("join", [lambda a, b: a, lambda a, b: np.concatenate([a, b]), lambda a, b: np.unique(b)[:3]])
def test_points_of_another_sheet_are_refused(join):
    """They would silently name other points: a hole leaves the numbers of its points to others."""
    before = square(21)
    region = join(before.edges("left"), before.edges("right"))
    after = before.hole((0.05, 0.05), 0.02)
    with refused(match=r"^Fixed\.points: expected points of this sheet; they were taken"):
        simulated(sheet=after, loads=[Fixed(region)]).build("cpu")
    for sheet in (before, square(21), before.cut((-0.01, 0.0524), (0.03, 0.0524))):
        assert simulated(sheet=sheet, loads=[Fixed(region)]).build("cpu") is not None
    assert simulated(sheet=after, loads=[Fixed(np.array([0, 1]))]).build("cpu") is not None


def test_a_region_is_an_array_of_indices():
    sheet = square(9)
    left = sheet.edges("left")
    assert left.dtype == np.int32 and (left == np.flatnonzero(sheet.points[:, 0] < 1e-9)).all()
    assert type(sheet.points[left]) is np.ndarray and type(np.isin(np.arange(81), left)) is np.ndarray


def test_only_a_word_like_it_is_suggested():
    fields = ["cauchy", "stretch", "damage"]
    assert [suggestion(text, fields) for text in ("cauchi", "nosuch", "")] == [" (did you mean 'cauchy'?)", "", ""]
