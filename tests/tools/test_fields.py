"""Fields beside finite elements: both at the same points, on the right side of a crack, and drawn."""

from functools import partial

import numpy as np
import pytest

pytest.importorskip("skfem")

import fields


def test_both_fields_of_a_case_agree_and_are_drawn(tmp_path):
    found = fields.fields_of(fields.CASES["tension"], 21, "cpu")
    assert np.abs(found.difference).max() < 0.03
    assert found.row()[:3] == ["BA 6.1", "`tension`", "u2"] and len(found.points) == 441
    fields.draw([found], tmp_path / "fields.png")
    assert (tmp_path / "fields.png").stat().st_size > 4_000


def test_faces_of_a_crack_are_compared_each_with_its_own_side(monkeypatch):
    """Coarse elements and points, and little stretch: the faces open by a tenth of it, and both sides alike."""
    case = fields.CASES["crack"]
    coarse = fields.Case(
        case.scene,
        case.figure,
        0,
        partial(fields.stretched, defect="crack", stretch=1.1),
        {**case.settings, "stretch": 1.1},
    )
    monkeypatch.setattr(fields, "CELLS", 4)
    found = fields.fields_of(coarse, 21, "cpu")
    faces = (abs(found.points[:, 0]) < 1e-9) & (abs(found.points[:, 1]) < 0.07)
    assert faces.sum() > 8
    assert np.abs(found.difference[faces]).max() < 0.1
    assert found.elements[faces, 0].max() > 0.01
    assert found.elements[faces, 0].min() < -0.01


@pytest.mark.parametrize("options", [["--only", "tension"], ["--points", "21"]], ids=" ".join)
def test_a_part_does_not_replace_the_page(options, capsys):
    with pytest.raises(SystemExit):
        fields.main(options)
    assert "expected --out" in capsys.readouterr().err


def test_a_rigid_inclusion_stays():
    points = np.array([[0.0, 0.0], [0.05, 0.02], [0.2, 0.0]])
    moved = fields.stretched(points, "inclusion", 1.1)
    assert np.array_equal(moved[:2], np.zeros((2, 2)))
    assert 0.0 < moved[2, 0] < 0.02


@pytest.mark.parametrize("name", ["pressure_dynamic", "out_of_plane"])
def test_elements_of_stored_fields_are_at_any_place(name):
    field = fields.CASES[name].elements(np.array([[0.3, 0.4], [0.3, 0.6]]))
    assert np.isfinite(field).all()
    assert field[0, 2] == pytest.approx(field[1, 2], rel=0.02)
