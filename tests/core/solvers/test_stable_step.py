"""The stable step: against ARPACK on the same operator."""

import numpy as np
import pytest
from helpers import MU, NEO, array, build, square
from scipy.sparse.linalg import LinearOperator, eigs

from warp_pd import Bimodular, BondAssociated, BondBased, Explicit, Fixed, Neural, Nodal, Simulation
from warp_pd.kernels import block_sums
from warp_pd.solvers.explicit import FIRST_ITERATIONS


def largest_frequency(built):
    """omega_max by ARPACK on the same operator."""
    response = array(built, "response")
    n = built.simulation.sheet.size
    free = np.array([[(bits >> c) & 1 for c in range(3)] for bits in built.context.held]).ravel() == 0

    def apply(v):
        v = np.where(free, v.ravel(), 0.0)
        size = np.abs(v).max()
        built.solver.stable_step.direction.assign((v / size).reshape(n, 3))
        built.context.run("estimate")
        return size * response.numpy().ravel()

    start = np.where(free, np.random.default_rng(1).normal(size=3 * n), 0.0)
    operator = LinearOperator((3 * n, 3 * n), matvec=apply, dtype=float)
    return float(np.sqrt(eigs(operator, k=1, v0=start, tol=1e-5, return_eigenvectors=False)[0].real))


@pytest.mark.parametrize(("horizon", "weights"), [(1.5, "corrected"), (3.15, "plain"), (3.15, "published")])
def test_the_estimate_of_the_stable_step_is_right(horizon, weights):
    sheet = square(15)
    start = np.zeros((sheet.size, 3))
    start[:, 0] = 0.3 * sheet.points[:, 0]
    built = build(
        sheet, horizon=horizon, weights=weights, loads=[Fixed(sheet.edges("left"))], initial_displacement=start
    )
    estimate = built.solver.stable_step.omega(120)
    assert estimate == pytest.approx(largest_frequency(built), rel=0.01)


@pytest.mark.parametrize("stretch", [1.0, 1.3])
@pytest.mark.parametrize(
    "law",
    [
        BondBased(Bimodular(3.0 * MU)), Neural(NEO, evaluation="closed_form"), Nodal(NEO),
        *(BondAssociated(NEO, horizon=2.015, weights=w) for w in ("plain", "corrected", "published")),
    ],
    ids=["bond-based", "closed form", "nodal", "plain", "corrected", "published"],
)  # fmt: skip
def test_the_stable_step_is_a_bound(law, stretch):
    """Never above 2 / omega_max, and not far below; power iteration alone came out 1.1 % above, bond-based."""
    sheet = square(9)
    start = np.zeros((sheet.size, 3))
    start[:, :2] = (stretch - 1.0) * sheet.points
    built = Simulation(
        sheet, law, Explicit(1.0), loads=[Fixed(sheet.edges("left"))], initial_displacement=start
    ).build("cpu", 64)  # fmt: skip
    estimate = built.solver.estimate(FIRST_ITERATIONS)
    exact = 2.0 / largest_frequency(built)
    assert 0.97 * exact < estimate <= exact


def test_the_estimate_of_a_sheet_of_many_blocks_is_the_same(monkeypatch):
    sheet = square(41)

    def squared(groups):
        built = build(sheet, loads=[Fixed(sheet.edges("left"))])
        assert ("sums_of_all_in_groups" in {stored.name for stored in built.context.fields}) == groups
        assert built.solver.stable_step.omega(40) > 0.0
        return built.solver.stable_step._squared.numpy()

    alone = squared(groups=False)
    # Sheets of many blocks have more points.
    monkeypatch.setattr(block_sums, "MANY_BLOCKS", 5)
    monkeypatch.setattr(block_sums, "GROUP", 3)
    # 1681 points are 27 blocks, in 9 groups; the order of the sums differs.
    np.testing.assert_allclose(squared(groups=True), alone, rtol=1e-5)
