"""Bond-based law: arrays of a scene, wrong input."""

import pytest
from bond_based_cases import LAWS, built
from helpers import array, build, jittered, refused, square

from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    CriticalStretch,
    Explicit,
    NeoHookean,
    Newton,
    Sheet,
    Simulation,
)
from warp_pd.__main__ import build_scene


def names(built):
    return {stored.name for stored in built.context.fields}


def test_features_left_out_leave_no_array():
    sheet, cloud = square(9), jittered(9)
    shown = {"principal_stress", "wrinkle_level"}
    assert not names(built(sheet)) & {*shown, "intact_bonds", "bond_force", "stencil_common", "class_shape"}
    assert not names(built(cloud)) & {"commons", "shapes", "bond_force"}
    # The same names exist where a scene asks for them, or where the law uses intersections of families.
    assert names(built(sheet, fields=tuple(shown))) >= shown
    assert "wrinkle_level" in names(built(sheet, fields=("wrinkle_level",)))
    breakable = {"damage": CriticalStretch(9.0), "law": {"fast": False}}
    assert names(build(sheet, **breakable)) >= {"intact_bonds", "bond_force", "stencil_common", "class_shape"}
    assert names(build(cloud, **breakable)) >= {"commons", "shapes", "bond_force"}
    assert array(built(cloud), "weights").shape[1] == 81


LINE = Sheet.line(1.0, 1.0, density=1.0, points=9)
WRONG = [
    (lambda: Bimodular(0.0), "tension"),
    (lambda: Bimodular(1.0, -1.0), "compression"),
    (lambda: BondBased(LAWS["equal"], horizon=0.0), "horizon"),
    (lambda: BondBased(LAWS["equal"], state="plane strain"), "did you mean 'plane stress'"),
    (lambda: built(square(9), horizon=0.9), "horizon = 0.9"),
    (lambda: built(square(9), state="line"), "state = 'line'"),
    (lambda: built(LINE), "state = 'plane stress'"),
    (lambda: built(square(9), fields=("stress",)), "fields = 'stress'"),
    (
        lambda: Simulation(square(9), BondAssociated(NeoHookean(1.0, 1.0)), Explicit(1.0), fields=("stress",)).build(
            "cpu"
        ),
        "fields = 'stress': expected one of",
    ),
    (lambda: Newton(stiffness="secant"), "stiffness = 'secant'"),
    (
        lambda: Simulation(
            square(9), BondAssociated(NeoHookean(1.0, 1.0)), Newton(stiffness="constant")
        ).build("cpu"),
        "stiffness = 'constant'",
    ),
    (lambda: built(square(25), solver=Newton(preconditioner="multigrid")), "preconditioner = 'multigrid'"),
    (lambda: build_scene("notched_strip", {"start": 1.0}), "start = 1.0"),
    (lambda: build_scene("cantilever", {"ratio": 0.0}), "ratio = 0.0"),
]  # fmt: skip


@pytest.mark.parametrize(("make", "text"), WRONG, ids=[text for _, text in WRONG])
def test_wrong_input_is_one_line(make, text):
    with refused(text):
        make()


def test_bonds_without_a_modulus_in_compression_go_slack():
    assert [Bimodular(2.0, c).goes_slack for c in (0.0, 1.0, 2.0, None)] == [True, False, False, False]
