"""The comparison of checkouts has every scene, sees a difference, and goes on where one checkout refuses a case."""

import numpy as np
from compare_checkouts import PARTS, SCENES, Case, cases, compare, record
from study import scene_names


def test_every_scene_is_compared_and_names_are_unique():
    assert {scene for scene, _ in SCENES} == set(scene_names())
    names = [case.name for case in cases()]
    assert len(names) == len(set(names))
    assert {f"{part} f32" for part in PARTS} < set(names)


def test_a_difference_is_seen(capsys):
    before = {"a": ({"status": "finished", "history": {"time": "0x1"}}, np.array([[0.0, 0.0, 2.0]]))}
    assert compare(before, before) == 0
    after = {"a": ({"status": "finished", "history": {"time": "0x2"}}, np.array([[0.0, 0.0, 2.1]]))}
    assert compare(before, after) == 1
    assert "a: displacement (5.0e-02 of the largest), history (time)" in capsys.readouterr().out
    assert compare(before, {}) == 1


def test_a_case_that_a_checkout_refuses_has_its_error():
    def make():
        raise TypeError("no such argument")

    assert record(Case("a", make, 32), "cpu")[1] == {"error": "TypeError: no such argument"}
