"""Each bond of a lattice once, on a CPU: forces and rupture of the reference kernels, to the last bit."""

import numpy as np
import pytest
from bond_based_cases import CRACK, LAWS
from helpers import NEO, internal_force, jittered, sever, square

from warp_pd import BondAssociated, BondBased, CriticalStretch, Explicit, Sheet, Simulation
from warp_pd.parts.rupture import BreakingBonds

SHEETS = {
    "square": square(12),
    "cut": square(12).cut(*CRACK),
    "two materials": square(12).stiffened(square(12).points[:, 0] > 0.05, 7.0),
    "line": Sheet.line(1.0, 1.0, density=1.0, points=12),
}


def share_left(law):
    """Share of the bonds that are intact."""
    return np.unpackbits(law.intact.numpy().view(np.uint8)).sum() / law.families.bond_count


def both(sheet, horizon=3.015, precision=64, **parts):
    """The sheet with bonds computed once, and with the reference kernel; and a rough displacement."""
    state = "line" if sheet.lattice is not None and sheet.lattice.rows == 1 else "plane stress"
    found = []
    for fast in (True, False):
        law = BondBased(LAWS["bimodular"], horizon, state, fast=fast)
        built = Simulation(sheet, law, Explicit(1.0), **parts).build("cpu", precision)
        found.append(built)
    rough = np.random.default_rng(0).standard_normal((sheet.size, 3))
    start = 0.1 * sheet.spacing * rough
    start[:, 0] += 0.1 * sheet.points[:, 0]
    return *found, start


def computes_once(built):
    return "forces_ahead" in {stored.name for stored in built.context.fields}


@pytest.mark.parametrize(
    ("name", "horizon", "precision"),
    [
        ("square", 1.5, 32), ("square", 4.15, 64), ("cut", 6.015, 32), ("two materials", 3.015, 64),
        ("line", 1.5, 32), ("line", 6.015, 64),
    ],
)  # fmt: skip
def test_forces_are_those_of_the_reference_kernel_to_the_last_bit(name, horizon, precision):
    fast, slow, start = both(SHEETS[name], horizon, precision)
    assert computes_once(fast)
    assert not computes_once(slow)
    forces = internal_force(fast, start)
    np.testing.assert_array_equal(forces, internal_force(slow, start))
    assert np.abs(forces).max() > 0.0


@pytest.mark.parametrize("horizon", [3.015, 6.015])
def test_broken_bonds_pull_at_neither_end(horizon):
    fast, slow, start = both(square(12), horizon, damage=CriticalStretch(9.0))
    whole = internal_force(fast, start)
    for built in (fast, slow):
        sever(built, CRACK)
    forces = internal_force(fast, start)
    np.testing.assert_array_equal(forces, internal_force(slow, start))
    assert np.abs(forces - whole).max() > 0.0
    assert np.abs(forces.sum(axis=0)).max() < 1e-12 * np.abs(forces).sum()


def test_a_tear_runs_as_with_the_reference_kernel():
    """Bonds break in both runs in the same steps."""
    fast, slow, start = both(square(12), damage=CriticalStretch(1.25))
    for built in (fast, slow):
        internal_force(built, 2.0 * start)
        built.solver._set_step(1e-6, 0.0)
        for _ in range(5):
            built.context.run("step")
    intact = fast.law.intact.numpy()
    left = share_left(fast.law)
    assert 0.05 < left < 0.95
    np.testing.assert_array_equal(intact, slow.law.intact.numpy())
    np.testing.assert_array_equal(fast.state.displacement.numpy(), slow.state.displacement.numpy())


def test_a_cloud_keeps_the_reference_kernel():
    fast, slow, start = both(jittered(9))
    assert not computes_once(fast)
    np.testing.assert_array_equal(internal_force(fast, start), internal_force(slow, start))


@pytest.mark.parametrize("law", [BondBased(LAWS["equal"], 3.015), BondAssociated(NEO, horizon=3.015)])
@pytest.mark.parametrize("spared", [None, range(0, 700, 3)])
def test_screened_bonds_break_as_without_screening(monkeypatch, law, spared):
    """Blocks of points without a bond that exceeds the criterion are passed by; all else is the same, bit for bit."""
    sheet = Sheet.rectangle(0.2, 0.05, thickness=1e-3, density=1e3, points=(61, 16))
    # One corner is stretched: some blocks of the 976 points break, others do not.
    start = np.zeros((sheet.size, 3))
    start[:, 0] = 0.4 * np.maximum(sheet.points[:, 0] - 0.15, 0.0)
    start += 0.02 * sheet.spacing * np.random.default_rng(1).standard_normal(start.shape)
    runs = []
    for screens in (True, False):
        # Screening has no option, as it changes no bit.
        monkeypatch.setattr(BreakingBonds, "screens", screens)
        simulation = Simulation(
            sheet, law, Explicit(1.0), damage=CriticalStretch(1.3, spared=spared), initial_displacement=start
        )  # fmt: skip
        built = simulation.build("cpu", 64)
        assert ("exceeding" in {stored.name for stored in built.context.fields}) == screens
        built.context.run("start")
        built.context.run("setup")
        built.solver._set_step(1e-5, 0.0)
        for _ in range(3):
            built.context.run("step")
        runs.append(built)
    screened, plain = runs
    left = share_left(plain.law)
    assert 0.5 < left < 0.999
    assert screened.context.fields["exceeding"].numpy().min() == 0
    np.testing.assert_array_equal(screened.law.intact.numpy(), plain.law.intact.numpy())
    np.testing.assert_array_equal(screened.state.displacement.numpy(), plain.state.displacement.numpy())
    np.testing.assert_array_equal(screened.rupture.released.numpy(), plain.rupture.released.numpy())


def test_a_step_looks_at_each_bond_once_for_force_and_rupture():
    """Other stages, and criteria that are no stretch, keep kernels of their own."""
    fast, slow, _ = both(SHEETS["square"], damage=CriticalStretch(1.25))

    def launched(built, stage):
        return [part for item in built.context.stages[stage] for part in item.parts]

    step = launched(fast, "step")
    assert "screen" not in step and step.count("forces_ahead") == 1
    assert step.index("forces_ahead") < step.index("break_bonds") < step.index("sum_both_halves")
    assert launched(fast, "setup") == ["forces_ahead", "sum_both_halves"]
    assert "screen" in launched(slow, "step")


@pytest.mark.parametrize("precision", [32, 64])
def test_a_bond_at_its_critical_stretch_is_looked_at(precision):
    """Whatever the rounding: a bond that breaks is never passed by."""
    sheet, stretch = square(12), 1.25
    fast, slow, _ = both(sheet, precision=precision, damage=CriticalStretch(stretch))
    for factor in (1.0 - 1e-7, 1.0, 1.0 + 1e-7, 1.0 + 1e-6):
        for built in (fast, slow):
            built.state.velocity.zero_()
            internal_force(built, (factor * stretch - 1.0) * sheet.positions)
            built.solver._set_step(1e-12, 0.0)
            built.context.run("step")
        np.testing.assert_array_equal(fast.law.intact.numpy(), slow.law.intact.numpy())
        np.testing.assert_array_equal(fast.state.force.numpy(), slow.state.force.numpy())
    assert share_left(fast.law) < 1.0


def test_all_stages_share_the_array_of_forces():
    built, *_ = both(SHEETS["square"])
    assert [stored.name for stored in built.context.fields].count("forces_ahead") == 1
