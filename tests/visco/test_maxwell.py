"""Maxwell elements: closed forms of relaxation, creep, hysteresis and moduli; wrinkles of least energy; torn strips."""

import numpy as np
import pytest
import warp as wp
from helpers import square
from resumed_runs import require_same_when_stopped
from scipy.integrate import cumulative_trapezoid

from warp_pd import (
    Explicit,
    Fixed,
    Maxwell,
    MooneyRivlin,
    Motion,
    NeoHookean,
    Ogden,
    Simulation,
    TearingEnergy,
    TensionField,
    Visco,
)
from warp_pd.kernels.numeric import constants_of, numeric
from warp_pd.kernels.visco.maxwell import ElasticNetwork, maxwell
from warp_pd.materials import padded_constants

MU = 1.0
BRANCHES = ((0.7, 0.05), (1.5, 0.6))


def along(material, bits, paths, steps):
    """S, C* - I, energy and sum of losses along paths of G, (paths, steps, 2, 2), at time steps (paths, steps)."""
    types = numeric(bits)
    real, vec4, mat22 = types.real, types.parameters, types.mat22
    network = ElasticNetwork(material.functions, material.on_device.response, TensionField(material).wrinkle_width)
    law, energy = maxwell(network, bits), material.functions(bits)[1]
    advance, respond, stored = law.advance, law.respond, law.stored
    Constants = constants_of(material.functions(bits)[0])

    @wp.kernel(module="unique", enable_backward=False)
    def follow(
        paths: wp.array2d(dtype=mat22), step: wp.array2d(dtype=real), c: Constants, terms: wp.array(dtype=vec4),
        state: wp.array2d(dtype=vec4), S: wp.array2d(dtype=mat22), strain: wp.array2d(dtype=mat22),
        W: wp.array2d(dtype=real), lost: wp.array2d(dtype=real),
    ):  # fmt: skip
        i = wp.tid()
        total = real(0.0)
        for n in range(paths.shape[1]):
            now, more = advance(paths[i, n], c, i, 0, 1, step[i, n], terms, state)
            total += more
            S[i, n] = now
            lost[i, n] = total
            _S, found = respond(paths[i, n], c, i, 0, 1, real(0.0), terms, state)
            strain[i, n] = found
            W[i, n] = energy(found, c) + stored(found, i, 0, 1, terms, state)

    shape, known = paths.shape[:2], padded_constants(material)
    constants = wp.types.vector(length=len(known), dtype=real)(*known)
    terms = wp.array([(m, t, 0.0, 0.0) for m, t in BRANCHES], dtype=vec4, device="cpu")
    state = wp.zeros((2, shape[0]), dtype=vec4, device="cpu")
    out = [wp.zeros(shape, dtype=kind, device="cpu") for kind in (mat22, mat22, real, real)]
    given = [wp.array(paths, dtype=mat22, device="cpu"), wp.array(steps, dtype=real, device="cpu")]
    wp.launch(follow, shape[0], inputs=[*given, constants, terms, state, *out], device="cpu")
    return [array.numpy().astype(float) for array in out]


def pulled(stretches, across=0.2):
    """G of sheets pulled to a stretch and pushed together across it, so that they wrinkle: uniaxial tension."""
    G = np.zeros((*np.shape(stretches), 2, 2))
    G[..., 0, 0], G[..., 1, 1] = stretches**2 - 1.0, across**2 - 1.0
    return G


def uniaxial(stretch, dt):
    """First Piola stress of the elastic network and the branches in uniaxial tension, by quadrature of M."""
    t = dt * np.arange(1, len(stretch) + 1)
    total = MU * (stretch - stretch**-2)
    for modulus, time in BRANCHES:
        M = [
            np.exp(-t / time) * (1.0 + cumulative_trapezoid(np.exp(t / time) * rate / time, t, initial=0.0))
            for rate in (stretch**-2, stretch)
        ]
        total += modulus * (M[0] * stretch - M[1] / stretch**2)
    return total


COUNT = 4000
T = np.linspace(0.0, 1.0, COUNT + 1)[1:]
OMEGA, LONG = 2.0 * np.pi * 3.0, 8.0
CYCLES = np.interp(T, np.linspace(0.0, 1.0, 6), [1.0, 2.5, 2.0, 2.5, 2.0, 2.5])


def creep(t):
    """Strain under a constant small stress of mu: of a spring with two Maxwell elements in parallel, by its modes."""
    moduli, times = np.array(BRANCHES).T
    inner = np.diag(-1.0 / times) + np.outer(np.ones(2), moduli / times) / (MU + moduli.sum())
    # d(e - e_v)/dt = de/dt - (e - e_v) / time at constant stress MU e + sum m (e - e_v) = MU.
    values, vectors = np.linalg.eig(inner)
    first = np.full(2, MU / (MU + moduli.sum()))
    parts = (vectors * np.linalg.solve(vectors, first)) @ np.exp(np.outer(values, t))
    return (MU - moduli @ parts) / MU


@pytest.fixture(scope="module")
def followed():
    """Paths in float64: held at 2.5, cycles between 2 and 2.5, small oscillations in tension, small creep."""
    small = 1e-6
    waves = 1.0 + small * (6.0 + np.sin(OMEGA * LONG * T))
    paths = np.stack([np.full(COUNT, 2.5), CYCLES, waves, 1.0 + small * creep(T)])
    steps = np.outer([1.0, 1.0, LONG, 1.0], np.full(COUNT, 1.0 / COUNT))
    found = along(MooneyRivlin(0.5 * MU), 64, pulled(paths), steps)
    return paths, small, found[0][..., 0, 0] * paths, found


def test_relaxation_is_a_sum_of_exponentials(followed):
    _, _, stress, _ = followed
    # The first step has half of its decay.
    t = (np.arange(COUNT) + 0.5) / COUNT
    wanted = (MU + sum(m * np.exp(-t / time) for m, time in BRANCHES)) * (2.5 - 2.5**-2)
    np.testing.assert_allclose(stress[0], wanted, rtol=1e-9)


def test_hysteresis_is_that_of_the_convolution(followed):
    """Stress of every cycle within 0.5 % of the largest, area of the loops, and what the law says is lost."""
    paths, _, stress, found = followed
    wanted = uniaxial(paths[1], 1.0 / COUNT)
    assert np.abs(stress[1] - wanted).max() < 2e-3 * np.abs(wanted).max()
    energy, lost = found[2][1], found[3][1]
    work = cumulative_trapezoid(stress[1], paths[1], initial=0.0)
    assert lost[-1] > 0.2 * work.max() and np.diff(lost).min() >= 0.0
    assert np.abs(energy + lost - work - (energy[0] + lost[0])).max() < 1e-3 * work.max()
    again = T >= 0.6
    area = cumulative_trapezoid(wanted[again], paths[1][again], initial=0.0)[-1]
    assert energy[-1] - energy[again][0] + lost[-1] - lost[again][0] == pytest.approx(area, rel=5e-3)


def test_storage_and_loss_modulus_are_those_of_maxwell_elements(followed):
    _, small, stress, _ = followed
    t = LONG * T
    last = t > 7.0
    fit = np.column_stack([np.sin(OMEGA * t), np.cos(OMEGA * t), np.ones(COUNT)])[last]
    storage, loss, _ = np.linalg.lstsq(fit, stress[2][last] / small, rcond=None)[0] / 3.0
    squares = [(m, (OMEGA * time) ** 2, OMEGA * time) for m, time in BRANCHES]
    assert storage == pytest.approx(MU + sum(m * s / (1.0 + s) for m, s, _ in squares), rel=2e-3)
    assert loss == pytest.approx(sum(m * w / (1.0 + s) for m, s, w in squares), rel=2e-3)


def test_creep_keeps_its_stress(followed):
    _, small, stress, _ = followed
    np.testing.assert_allclose(stress[3][5:] / (3.0 * small), MU, rtol=2e-3)


@pytest.mark.parametrize("material", [NeoHookean(MU, 100.0), Ogden((1.0, 0.05), (1.3, 5.0))], ids=["slight", "ogden"])
def test_wrinkles_have_the_least_energy(material):
    """After other strains S is the derivative of the energy, never compressive, and zero across wrinkles."""
    rng = np.random.default_rng(0)
    F = np.eye(2) + rng.uniform(-1.0, 1.0, (300, 4, 2, 2)) * np.geomspace(1e-3, 2.0, 300)[:, None, None, None]
    G = np.einsum("...ki,...kj->...ij", F, F) - np.eye(2)
    # In the last state no time passes: its energy is a function of G alone.
    steps = rng.uniform(0.01, 0.5, (300, 4)) * [1.0, 1.0, 1.0, 0.0]
    nudge = 1e-5 * np.array([[0.3, 0.7], [0.7, -0.5]])
    histories = [np.concatenate([G[:, :3], (G[:, 3] + s * nudge)[:, None]], axis=1) for s in (-1.0, 0.0, 1.0)]
    runs = [along(material, 64, path, steps) for path in histories]
    S, strain, _, lost = runs[1]
    assert np.diff(lost, axis=1).min() >= 0.0 and np.isfinite(S).all()
    S, moved = S[:, 3], strain[:, 3] - G[:, 3]
    size = 1.0 + np.abs(S).max(axis=(1, 2))
    narrowed = np.linalg.eigvalsh(moved)
    wrinkled, slack = narrowed[:, 1] > 1e-6, narrowed[:, 0] > 1e-6
    assert wrinkled.sum() > 100 and slack.sum() > 20 and (~wrinkled).sum() > 50 and narrowed.min() > -1e-9
    assert (np.linalg.eigvalsh(S)[:, 0] / size).min() > -1e-10
    assert (np.abs(np.einsum("nij,nij->n", S, moved)) / size).max() < 1e-10
    slope = (runs[2][2][:, 3] - runs[0][2][:, 3]) / 1e-5
    exact = np.einsum("nij,ij->n", S, nudge) / 1e-5
    assert np.quantile(np.abs(slope - exact) / size, 0.99) < 1e-4
    if isinstance(material, NeoHookean):
        single = along(material, 32, histories[1], steps)
        assert (np.abs(single[0][:, 3] - S).max(axis=(1, 2)) / size).max() < 2e-4


def torn_strip(points, solver):
    """A sheet pulled at 30 1/s whose middle tears and whose edges wrinkle and recoil."""
    sheet = square(points).cut((-0.01, 0.0507), (0.03, 0.0507))
    left, right = sheet.edges("bottom"), sheet.edges("top")
    return Simulation(
        sheet,
        Visco(TensionField(NeoHookean(1e5, 1e7)), 2.015, branches=(Maxwell(1e5, 1e-3), Maxwell(1e5, 0.02))),
        solver,
        loads=[Fixed(left), Motion(right, times=[0.0, 0.02, 0.03], x=0.0, y=[0.0, 0.06, 0.06], z=0.0)],
        damage=TearingEnergy(1200.0, spared=np.concatenate([left, right])),
    )


def test_a_torn_strip_balances_its_energy():
    result = torn_strip(15, Explicit(0.03, frames=30, safety=0.2)).run(device="cpu", precision=64)
    assert result.status == "finished"
    lost = [row["viscous"] for row in result.history]
    last = result.history[-1]
    assert last["rupture"] > 0.1 * last["external"] and last["viscous"] > 0.1 * last["external"]
    assert np.diff(lost).min() >= 0.0
    assert max(abs(row["balance_error"]) for row in result.history) < 5e-3


def pulled_sheet(solver):
    """A sheet that is pulled and does not tear."""
    sheet = square(7)
    motion = Motion(sheet.edges("right"), times=[0.0, solver.duration], x=0.02, y=0.0, z=0.0)
    law = Visco(NeoHookean(1e5, 1e7), 2.015, branches=(Maxwell(1e5, 1e-3),))
    return Simulation(sheet, law, solver, loads=[Fixed(sheet.edges("left")), motion])


# Frames apart, so that the steps of each have another length.
APART = (0.0041, 0.01, 0.0173, 0.03)


@pytest.mark.parametrize("precision", [32, 64])
def test_explicit_steps_go_on_bit_for_bit(precision, tmp_path):
    """The force at the end of a step has half of its decay, which the state at its end no longer has."""
    require_same_when_stopped(lambda: pulled_sheet(Explicit(0.03, frames=APART)), tmp_path, [2, 4], precision)


@pytest.mark.parametrize("precision", [32, 64])
def test_a_torn_strip_goes_on_bit_for_bit(precision, tmp_path):
    result = require_same_when_stopped(lambda: torn_strip(9, Explicit(0.03, frames=APART)), tmp_path, [3, 4], precision)
    assert result.history[2]["mean_damage"] > result.history[1]["mean_damage"]
