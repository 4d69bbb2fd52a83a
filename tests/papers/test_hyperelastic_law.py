"""Bond-based law of hyperelastic sheets: arrays and launches of a scene, wrong input."""

import pytest
from helpers import build as build_bond_associated
from helpers import refused, square
from hyperelastic_cases import build

from warp_pd import BondNeoHookean, CriticalStretch, HyperelasticBonds, NeoHookean, Newton, Sheet


def test_features_left_out_leave_no_array():
    sheet = square(11)
    plain, breakable = (
        {stored.name for stored in build(sheet, **parts).context.fields}
        for parts in ({}, {"damage": CriticalStretch(2.0)})
    )
    assert breakable - plain >= {"intact_bonds"}
    # A law with intersections of families and an energy has all of these.
    unused = {"class_shape", "stencil_common", "bond_force", "strain_energy"}
    assert unused <= {stored.name for stored in build_bond_associated(sheet, law={"fast": False}).context.fields}
    assert not unused & plain
    launches = {launch.name for launch in build(sheet).context.stages["step"]}
    assert launches == {"drift", "pair_force", "kick"}


@pytest.mark.parametrize(
    ("make", "says"),
    [
        (lambda: BondNeoHookean(-1.0), "mu = -1.0"),
        (lambda: BondNeoHookean(1.0, "biaxial"), "mode = 'biaxial'"),
        (lambda: BondNeoHookean(1.0, "planar", "mine"), "fit = 'mine'"),
        (lambda: HyperelasticBonds(NeoHookean(1.0, 1.0)), "BondNeoHookean"),
        (lambda: HyperelasticBonds(BondNeoHookean(1.0), horizon=0.0), "horizon = 0.0"),
        (lambda: build(square(11), solver=Newton()), "force = HyperelasticBonds"),
        (lambda: build(Sheet.line(1.0, 1.0, density=1.0, points=9)), "expected at least two rows of points"),
    ],
)
def test_wrong_input_is_named(make, says):
    with refused(match=says.replace("(", r"\(")):
        make()
