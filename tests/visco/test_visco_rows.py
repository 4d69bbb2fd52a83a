"""Visco by rows on a CPU, with Prony terms and with Maxwell elements, against the reference kernels."""

import numpy as np
import pytest
from curved_sheets import small_tube
from grid_sheets import holed
from helpers import internal_force, jittered, sever, square
from visco_laws import POLYUREA, TERMS

from warp_pd import (
    BondAssociated,
    CriticalStretch,
    Explicit,
    Maxwell,
    NeoHookean,
    Prony,
    Simulation,
    TearingEnergy,
    TensionField,
    Visco,
)

# Of the largest value of a field after STEPS steps.
TOLERANCE = {32: 2e-6, 64: 1e-12}
# What is lost is a difference of work and stored energy.
LOSS_TOLERANCE = {32: 5e-5, 64: 1e-12}
STEPS, STEP = 6, 2e-5
CUT = ((0.02, 0.031), (0.071, 0.08))
# Times that are constant and that depend on the rate, slow, and so fast that a step relaxes a term.
ALL_TERMS = (*TERMS, Prony(0.05e6, 0.01e6, time=0.5, exponent=0.6), Prony(0.02e6, time=1e-5))
PRONY = {"material": POLYUREA, "prony": ALL_TERMS}
BRANCHES = {
    "material": TensionField(NeoHookean(4e5, 4e7)), "prony": (), "branches": (Maxwell(0.2e6, 0.1), Maxwell(0.1e6, 1e-4))
}  # fmt: skip


def fields_after_steps(sheet, bits, fast, damage=None, tear=None, **law):
    """Force, displacement, internal variables, energies and losses of a sheet that flies apart, and its launches."""
    velocity = 300.0 * sheet.spacing * np.random.default_rng(0).normal(size=(sheet.size, 3))
    made = Visco(fast=fast, **{**PRONY, "horizon": 2.015, **law})
    built = Simulation(sheet, made, Explicit(1.0), initial_velocity=velocity, damage=damage).build("cpu", bits)
    if tear:
        tear(built)
    for name in ("start", "setup"):
        built.context.run(name)
    built.state.step.assign(np.array([STEP]))
    built.context.sequence("step", STEPS).run()
    built.context.run("frame")
    arrays = {
        "force": built.state.force, "displacement": built.state.displacement, "state": built.law.state,
        "stored": built.law.strain_energy,
    }  # fmt: skip
    names = [name for launch in built.context.stages["step"] for name in launch.parts]
    return {name: built.to_numpy(array) for name, array in arrays.items()}, built.to_numpy(built.law.viscous), names


def compare(sheet, bits, **options):
    found, lost, quick = fields_after_steps(sheet, bits, True, **options)
    expected, wanted, reference = fields_after_steps(sheet, bits, False, **options)
    for name, values in expected.items():
        assert np.isfinite(values).all() and np.abs(values).max() > 0.0, name
        assert np.abs(found[name] - values).max() <= TOLERANCE[bits] * np.abs(values).max(), name
    assert np.abs(lost - wanted).max() <= LOSS_TOLERANCE[bits] * wanted.max()
    assert reference.count("viscous_force") == 1 and "viscous_force" not in quick
    assert quick.count("family_rows_viscous") == 1 and "family_rows_viscous" not in reference


@pytest.mark.parametrize(
    ("sheet", "horizon", "torn", "bits"),
    [
        (square(13), 3.015, True, 64),
        (square(13), 3.015, False, 32),
        (jittered(11), 2.015, True, 32),
        (holed(19), 4.15, True, 64),
    ],
    ids=["torn lattice", "lattice", "torn cloud", "torn grid, two words"],
)
def test_a_step_is_that_of_the_reference_kernels(sheet, horizon, torn, bits):
    tear = {"damage": CriticalStretch(1e3), "tear": lambda built: sever(built, CUT)} if torn else {}
    compare(sheet, bits, horizon=horizon, **tear)


def test_corrected_weights():
    compare(square(11), 64, weights="corrected")


def test_maxwell_elements_that_wrinkle_and_tear():
    compare(square(11), 64, damage=TearingEnergy(3e3, cut_profile=False), **BRANCHES)


def test_a_curved_sheet():
    compare(small_tube(), 64, horizon=2.5)


def test_off_the_path_the_state_is_kept():
    """The force of the set-up and of the estimate of the stable step responds at once and relaxes nothing."""
    sheet = square(9)
    law = Visco(POLYUREA, 2.015, prony=TERMS)
    start = 0.05 * np.column_stack([sheet.points, np.zeros(sheet.size)])
    built = Simulation(sheet, law, Explicit(1.0), initial_displacement=start).build("cpu", 64)
    built.context.run("start")
    before = [array.numpy() for array in (built.law.state, built.law.viscous_work)]
    assert all(values.any() for values in before)
    for _ in range(2):
        built.context.run("setup")
    assert "family_rows_viscous" in [name for launch in built.context.stages["setup"] for name in launch.parts]
    for values, array in zip(before, (built.law.state, built.law.viscous_work), strict=True):
        assert (array.numpy() == values).all()


def test_bits_repeat():
    """Twice the same run: the same bits."""
    first, second = (fields_after_steps(square(9), 32, True)[0] for _ in range(2))
    assert all((first[name] == values).all() for name, values in second.items())


def test_without_prony_terms_it_is_the_elastic_law():
    """By rows to the last bit, by the reference kernels to rounding; CriticalEnergy finds the forces of all pairs."""
    sheet = square(11)
    u = 0.02 * sheet.spacing * np.random.default_rng(0).normal(size=(sheet.size, 3))
    laws = (BondAssociated(POLYUREA, 2.015), Visco(POLYUREA, 2.015), Visco(POLYUREA, 2.015, fast=False))
    forces, names, pairs = [], [], []
    for law in laws:
        built = Simulation(sheet, law, Explicit(1.0)).build("cpu", 64)
        forces.append(internal_force(built, u))
        names.append([name for launch in built.context.stages["step"] for name in launch.parts])
        pairs.append(built.law.pairs.numpy())
    assert "family_rows_force" in names[1] and "variational_force" in names[2]
    np.testing.assert_array_equal(forces[1], forces[0])
    for found in (forces, pairs):
        assert np.abs(found[1] - found[2]).max() <= 1e-12 * np.abs(found[2]).max()
