"""Tables kept from run to run: never those of another sheet or law, never more than they may take."""

from dataclasses import replace

import numpy as np
import pytest
from helpers import GENT, jittered, square
from small_runs import run

from warp_pd import Fixed, Newton, Pressure
from warp_pd.device.result_cache import ResultCache, content
from warp_pd.laws import weight_tables

LATTICE, CLOUD = square(9), jittered(9)
SCENES = {
    "lattice": (LATTICE, {}),
    "another horizon": (LATTICE, {"horizon": 1.5}),
    "other weights": (LATTICE, {"weights": "corrected"}),
    "another influence": (LATTICE, {"law": {"influence": "inverse"}}),
    "a function": (LATTICE, {"law": {"influence": lambda r: 2.0 - r}}),
    "another function": (LATTICE, {"law": {"influence": lambda r: 3.0 - r**2}}),
    "cut": (LATTICE.cut((0.03, 0.051), (0.08, 0.051)), {}),
    "another cut": (LATTICE.cut((0.03, 0.051), (0.06, 0.051)), {}),
    "another size": (square(9, 0.1001), {}),
    "varying thickness": (square(9, thickness=np.linspace(1e-3, 2e-3, 81)), {}),
    "another material": (LATTICE, {"material": GENT}),
    "single precision": (LATTICE, {"precision": 32}),
    "cloud": (CLOUD, {}),
    "another cloud": (jittered(9, seed=1), {}),
    "stiffer": (replace(CLOUD, stiffness=np.linspace(1.0, 2.0, CLOUD.size)), {}),
}


def found(name):
    sheet, parts = SCENES[name]
    done = run(sheet, Newton(), loads=[Fixed(sheet.edges("all")), Pressure(20.0, follower=False)], **parts)
    return done.frame.displacement.tobytes()


@pytest.fixture
def tables(monkeypatch):
    """Tables that this test alone keeps."""
    kept = ResultCache()
    monkeypatch.setattr(weight_tables, "TABLES", kept)
    return kept


def test_no_run_gets_the_tables_of_another_sheet_or_law(tables, monkeypatch):
    first = {name: found(name) for name in SCENES}
    # Materials and precisions share their tables, functions are not kept.
    assert len(tables) == len(SCENES) - 4
    again = {name: found(name) for name in reversed(SCENES)}
    monkeypatch.setattr(weight_tables, "TABLES", ResultCache(most=0))
    alone = {name: found(name) for name in SCENES}
    assert first == again == alone and len(set(alone.values())) == len(SCENES)


def test_a_sheet_that_is_changed_in_place_has_tables_of_its_own(tables):
    sheet = jittered(9)
    settings = 2.015, "linear", "plain"
    before = weight_tables.weight_tables(sheet, *settings)
    same = weight_tables.weight_tables(jittered(9), *settings)
    assert same[0] is before[0] and same[1] is before[1]
    kept = before[0].bonds.copy()
    sheet.points[40] += 1e-3
    after = weight_tables.weight_tables(sheet, *settings)
    assert after[0] is not before[0] and not np.array_equal(after[0].bonds, kept)
    assert np.array_equal(before[0].bonds, kept)


def test_what_is_kept_cannot_be_written_to(tables):
    families, inverse, weights, report = weight_tables.weight_tables(square(9), 2.015, "linear", "corrected")
    for array in (families.exists, families.bonds, inverse, weights):
        with pytest.raises(ValueError, match="read-only"):
            array[0] = 0
    report["left"] = 1.0
    assert weight_tables.weight_tables(square(9), 2.015, "linear", "corrected")[3]["left"] < 1.0


def test_memory_is_bounded_and_the_last_ones_stay():
    made, kept = [], ResultCache(most=8000)

    def make(number, size):
        made.append(number)
        return np.full(size, float(number))

    for number in range(20):
        kept.result(make, number, 300)
        kept.result(make, 0, 300)
        assert kept.nbytes == 2400 * len(kept) <= 8000
    assert made == list(range(20))
    kept.result(make, 100, 600)
    kept.result(make, 100, 600)
    assert made[-2:] == [100, 100] and len(kept) == 3
    with pytest.raises(ZeroDivisionError):
        kept.result(lambda one: 1 / one, 0)


def test_content_tells_values_apart():
    values = [
        None, True, 1, 1.0, "1", (1,), [1], (1, 2), ((1,), 2), (1, (2,)), "", (), -0.0, 0.0, {"a": 1}, {"a": (1,)},
        np.nan, np.zeros(2), np.zeros((2, 1)), np.zeros(2, np.float32), np.zeros(4, np.float32), np.zeros(0),
        np.float64(1.0), LATTICE, CLOUD,
    ]  # fmt: skip
    keys = [content(value) for value in values]
    assert None not in keys and len(set(keys)) == len(values)
    assert keys == [content(value) for value in values]
    assert content(lambda: 1) is None and content((1, {2})) is None and content(np.array([None])) is None
