"""The fast kernels of the bond-associated law give what the plain ones give, on random states with damage."""

import numpy as np
import pytest
import warp as wp
from helpers import GENT, MU, NEO, array, build, internal_force, jittered, sever, square

from warp_pd import CriticalStretch, Explicit, Gent, launches
from warp_pd.laws import fast_path

TOLERANCE = {32: 2e-6, 64: 1e-12}


@pytest.fixture
def blocks(monkeypatch):
    """Blocks of threads as on a GPU, here on a CPU, one after the other."""
    monkeypatch.setattr(fast_path, "shares_memory", lambda device: True)
    monkeypatch.setattr(launches, "SPLIT_FROM", 10**9)
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


@pytest.fixture
def large_on_gpu(monkeypatch, blocks):
    """Take the kernels of large sheets on a GPU, here for small ones on a CPU."""
    monkeypatch.setattr(fast_path, "MOST_SHARED", 0)


def rough(sheet, seed=0):
    """A stretched, curved sheet with noise."""
    noise = np.random.default_rng(seed).uniform(-0.05, 0.05, (sheet.size, 3)) * sheet.spacing
    x, y = sheet.points.T
    return np.column_stack([0.3 * x + 0.01 * np.sin(60.0 * y), -0.1 * y, 0.02 * np.sin(40.0 * x * y / 0.1)]) + noise


def names(built):
    return [name for launch in built.context.stages["step"] for name in launch.parts]


def compare(sheet, horizon, bits, cut=None, broken="drop", material=GENT):
    parts = {"damage": CriticalStretch(1e3)} if cut else {}
    forces, launches = [], []
    for fast in (True, False):
        built = build(
            sheet, horizon=horizon, material=material, precision=bits, law={"fast": fast, "broken": broken}, **parts
        )
        if cut:
            sever(built, cut)
        forces.append(internal_force(built, rough(sheet)))
        launches.append(names(built))
    quick, plain = forces
    assert np.abs(quick - plain).max() <= TOLERANCE[bits] * np.abs(plain).max()
    return launches


@pytest.mark.parametrize(
    ("horizon", "bits", "material"),
    [(1.5, 64, GENT), (1.5, 32, NEO), (2.015, 32, GENT), (3.15, 64, NEO), (3.15, 32, GENT)],
)
def test_whole_families_inside_a_lattice(horizon, bits, material):
    quick, plain = compare(square(15), horizon, bits, material=material)
    assert quick[1:3] == ["whole_family_force", "variational_force"]
    assert plain[1:2] == ["variational_force"]


@pytest.mark.parametrize("broken", ["drop", "redistribute"])
def test_families_with_broken_bonds(broken):
    compare(square(15), 2.015, 64, cut=((0.02, 0.031), (0.071, 0.08)), broken=broken)


@pytest.mark.parametrize("bits", [32, 64])
@pytest.mark.parametrize("cut", [None, ((0.02, 0.031), (0.071, 0.08))], ids=["whole", "torn"])
@pytest.mark.parametrize("sheet", [square(13), jittered(13), square(13).cut((0.0, 0.052), (0.06, 0.052))])
def test_a_thread_a_bond(blocks, sheet, cut, bits):
    """What a GPU does with small sheets."""
    quick, _ = compare(sheet, 3.15 if bits == 64 else 2.015, bits, cut=cut)
    assert quick[-3:-1] == ["family_block_force", "gather_from_mates"]


@pytest.mark.parametrize("broken", ["drop", "redistribute"])
@pytest.mark.parametrize("sheet", [square(13), jittered(13)], ids=["lattice", "cloud"])
def test_families_that_share_blocks(large_on_gpu, sheet, broken):
    """What a GPU does with families that are not whole."""
    quick, _ = compare(sheet, 2.015, 64, cut=((0.02, 0.031), (0.071, 0.08)), broken=broken)
    assert quick[-3:-1] == ["family_block_force", "gather_from_mates"]


def test_a_large_family(large_on_gpu):
    """Where sums run over the members outside an intersection."""
    compare(square(13), 3.15, 64)


@pytest.mark.parametrize("cut", [None, ((0.02, 0.031), (0.071, 0.08))], ids=["whole", "torn"])
def test_forces_through_a_ring(monkeypatch, large_on_gpu, cut):
    """A large sheet in strips, here with a small ring."""
    monkeypatch.setattr(fast_path, "RING", 300)
    quick, _ = compare(square(33), 2.015, 64, cut=cut)
    assert quick.count("whole_family_force") > 4
    assert quick.count("gather_from_mates") == quick.count("whole_family_force")


def test_the_list_of_other_points_is_used_up(large_on_gpu):
    built = build(square(13), damage=CriticalStretch(1e3))
    first = internal_force(built, rough(built.simulation.sheet))
    assert array(built, "other_count").numpy()[0] == 0
    assert (internal_force(built, rough(built.simulation.sheet)) == first).all()
    listed = np.unique(array(built, "other_points").numpy())
    inner = built.law.families.kind == built.law.fast_path.stencil[1]
    assert set(np.flatnonzero(~inner)) <= set(listed)


def test_rupture_ends_alike():
    """A sheet that tears breaks the same bonds at the same time on both paths."""
    results = []
    for fast in (True, False):
        built = build(
            square(15), horizon=2.015, law={"fast": fast}, damage=CriticalStretch(1.5), solver=Explicit(duration=0.02)
        )
        sheet, intact = built.simulation.sheet, built.law.intact.numpy().copy()
        built.state.velocity.assign(np.column_stack([120.0 * sheet.points[:, 0], 0 * sheet.points]))
        internal_force(built, np.zeros((sheet.size, 3)))
        built.state.step.fill_(2e-5)
        built.context.sequence("step", 400).run()
        results.append((built.law.intact.numpy().copy(), built.to_numpy(built.state.displacement)))
    (alive, moved), (plain_alive, plain_moved) = results
    assert (alive == plain_alive).all()
    assert (alive != intact).any()
    assert np.abs(moved - plain_moved).max() < 1e-9 * np.abs(plain_moved).max()


class Woven(Gent):
    """A material that does not claim to be isotropic."""

    isotropic = False


def test_what_has_no_fast_kernels():
    assert build(square(15), weights="published").force.fast_path is None
    assert build(square(15), material=Woven(MU, 2e5, 160.0)).force.fast_path is None
    assert build(jittered(13)).force.fast_path is None
    assert build(square(5), horizon=3.15).force.fast_path is None
    assert build(square(15), law={"fast": False}).force.fast_path is None
