"""Arrays of large lattices are computed when asked for, and are those of small ones."""

import gc
from dataclasses import replace

import numpy as np
import pytest

from warp_pd import BondAssociated, Explicit, Fixed, InputError, MooneyRivlin, Sheet, Simulation
from warp_pd.geometry import on_demand, rectangles
from warp_pd.geometry.on_demand import OnDemand, mean_of

SIZE = {"thickness": 1e-3, "density": 1000.0}
ARRAYS = ("points", "areas", "triangles")


def plates(monkeypatch, **changed):
    """A stored sheet, and the same one on demand."""
    options = {"points": (37, 23), "origin": (0.1, 0.3), **SIZE, **changed}
    stored = Sheet.rectangle(1.0, 0.7, **options)
    monkeypatch.setattr(rectangles, "STORED_POINTS", 0)
    # Several pieces of each array.
    monkeypatch.setattr(on_demand, "CHUNK", 100)
    return stored, Sheet.rectangle(1.0, 0.7, **options)


@pytest.mark.parametrize("changed", [{}, {"centred": True}, {"layers": (2, 1)}])
def test_they_are_the_same_arrays(monkeypatch, changed):
    stored, computed = plates(monkeypatch, **changed)
    assert all(isinstance(computed.stored(name), OnDemand) for name in ARRAYS)
    for name in ARRAYS:
        one, other = getattr(stored, name), getattr(computed, name)
        assert one.dtype == other.dtype
        np.testing.assert_array_equal(one, other)
        some = np.array([3, 0, 400, 7])
        np.testing.assert_array_equal(computed.stored(name)[some], one[some])
    assert repr(stored) == repr(computed) and stored.size == computed.size
    for edges in ((), ("left",), ("right", "top"), ("bottom",)):
        np.testing.assert_array_equal(stored.edges(*edges), computed.edges(*edges))


def test_a_whole_array_is_kept_as_long_as_anyone_holds_it(monkeypatch):
    _, computed = plates(monkeypatch)
    points = computed.points
    assert computed.points is points
    before = len(on_demand._origins)
    del points
    gc.collect()
    assert len(on_demand._origins) == before - 1


def test_copies_compute_too_and_changed_ones_store(monkeypatch):
    stored, computed = plates(monkeypatch)
    assert all(isinstance(replace(computed, thickness=2.0).stored(name), OnDemand) for name in ARRAYS)
    for change in (
        lambda s: s.hole((0.5, 0.6), 0.1),
        lambda s: s.cut((0.1, 0.61), (0.5, 0.61)),
        lambda s: s.cut((0.1, 0.61), (0.5, 0.61)).cut((0.2, 0.4), (0.7, 0.9)),
        lambda s: s.as_cloud().cut((0.1, 0.61), (0.5, 0.61)).cut((0.2, 0.4), (0.7, 0.9)),
        lambda s: s.turned(20),
    ):
        one, other = change(stored), change(computed)
        for name in ARRAYS:
            np.testing.assert_array_equal(getattr(one, name), getattr(other, name))


def test_points_of_another_sheet_are_refused_all_the_same(monkeypatch):
    _, computed = plates(monkeypatch)
    _, other = plates(monkeypatch, points=(37, 24))
    law = BondAssociated(MooneyRivlin(1e5, 0.0), horizon=2.015)
    Simulation(computed, law, Explicit(1.0), loads=[Fixed(computed.edges("left"))]).check()
    Simulation(computed, law, Explicit(1.0), loads=[Fixed(plates(monkeypatch)[1].edges("left"))]).check()
    with pytest.raises(InputError, match="expected points of this sheet"):
        Simulation(computed, law, Explicit(1.0), loads=[Fixed(other.edges("left"))]).check()


@pytest.mark.parametrize("points", [(1201, 801), (1000, 1000), (524288, 3)])
def test_the_mean_is_that_of_numpy_to_the_last_bit(points):
    sheet = Sheet.rectangle(1.1, 0.7, points=points, **SIZE)
    areas = sheet.stored("areas")
    assert isinstance(areas, OnDemand)
    by_index = areas.of(np.arange(len(areas)))
    np.testing.assert_array_equal(areas.whole(), by_index)
    assert mean_of(areas) == by_index.mean() and mean_of(by_index) == by_index.mean()
