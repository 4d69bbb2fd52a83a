"""Fast kernels of the bond-associated law agree with the reference kernels on random states with damage."""

import numpy as np
import pytest
import warp as wp
from curved_sheets import rough_motion, small_tube
from grid_sheets import holed, partly_off_the_grid
from helpers import GENT, MU, NEO, array, build, internal_force, jittered, sever, soften, square, strain_energy

from warp_pd import BondAssociated, CriticalStretch, Explicit, Gent, Newton, Sheet, TearingEnergy, Visco
from warp_pd.device import graph
from warp_pd.families import pack
from warp_pd.laws import family_struct, fast_path

TOLERANCE = {32: 2e-6, 64: 1e-12}
# An energy is of second order in a strain that float32 knows to 1e-6 of one.
ENERGY_TOLERANCE = {32: 1e-5, 64: 1e-12}
CUT = ((0.02, 0.031), (0.071, 0.08))


class Woven(Gent):
    """A material that does not claim to be isotropic."""

    isotropic = False


class Hasty(Gent):
    """A material whose stress does not start from a guess."""

    near = None


@pytest.fixture
def blocks(monkeypatch):
    """Run blocks of threads on a CPU as on a GPU, one after the other."""
    monkeypatch.setattr(fast_path, "shares_memory", lambda device: True)
    monkeypatch.setattr(fast_path, "COMPACT_FROM", 0)
    monkeypatch.setattr(graph, "SPLIT_FROM", float("inf"))
    monkeypatch.setattr(wp.config, "enable_cpu_blocks", True)


@pytest.fixture
def large_on_gpu(monkeypatch, blocks):
    """Use the kernels for large sheets on a GPU with small sheets on a CPU."""
    monkeypatch.setattr(fast_path, "MAX_SHARED", 0)


def rough(sheet, seed=0):
    """A stretched, curved sheet with noise."""
    noise = np.random.default_rng(seed).uniform(-0.05, 0.05, (sheet.size, 3)) * sheet.spacing
    x, y = sheet.points.T
    return np.column_stack([0.3 * x + 0.01 * np.sin(60.0 * y), -0.1 * y, 0.02 * np.sin(40.0 * x * y / 0.1)]) + noise


def launch_names(built):
    return [name for launch in built.context.stages["step"] for name in launch.parts]


def energy_of_families(built, displacement):
    strain_energy(built, displacement)
    return built.law.strain_energy.numpy()


def compare(sheet, horizon, bits, cut=None, broken="drop", material=GENT, law=None):
    parts = {"damage": CriticalStretch(1e3)} if cut else {}
    forces, energies, launches = [], [], []
    for fast in (True, False):
        built = build(
            sheet,
            horizon=horizon,
            material=material,
            precision=bits,
            law={"fast": fast, "broken": broken, **(law or {})},
            **parts,
        )
        if cut:
            sever(built, cut)
        forces.append(internal_force(built, rough(sheet)))
        energies.append(energy_of_families(built, rough(sheet)))
        launches.append(launch_names(built))
    quick, reference = forces
    assert np.abs(quick - reference).max() <= TOLERANCE[bits] * np.abs(reference).max()
    assert np.abs(energies[0] - energies[1]).max() <= ENERGY_TOLERANCE[bits] * energies[1].max()
    return launches


@pytest.mark.parametrize(
    ("horizon", "bits", "material"),
    [(1.5, 64, GENT), (1.5, 32, NEO), (2.015, 32, GENT), (3.15, 64, NEO), (3.15, 32, GENT)],
)
def test_undamaged_families_inside_a_lattice(large_on_gpu, horizon, bits, material):
    quick, reference = compare(square(15), horizon, bits, material=material)
    assert quick[1:3] == ["family_block_force", "undamaged_family_force"]
    assert reference[1:2] == ["variational_force"]


@pytest.mark.parametrize("bits", [32, 64])
@pytest.mark.parametrize("horizon", [1.5, 2.015, 3.15])
@pytest.mark.parametrize("cut", [None, CUT], ids=["undamaged", "torn"])
def test_undamaged_families_inside_a_lattice_whose_spacings_differ(large_on_gpu, horizon, bits, cut):
    quick, _ = compare(square((17, 15)), horizon, bits, cut=cut)
    assert "undamaged_family_force" in quick


@pytest.mark.parametrize("bits", [32, 64])
@pytest.mark.parametrize("cut", [None, CUT], ids=["undamaged", "torn"])
@pytest.mark.parametrize("horizon", [1.5, 3.15, 4.15])
@pytest.mark.parametrize(
    "sheet", [square(15), jittered(13), square(13).cut((0.0, 0.052), (0.06, 0.052)), holed(19)],
    ids=["lattice", "cloud", "slit", "grid"],
)  # fmt: skip
def test_a_cpu_sums_rows(sheet, horizon, cut, bits):
    quick, reference = compare(sheet, horizon, bits, cut=cut)
    assert "family_rows_force" in quick and "family_rows_force" not in reference


def test_a_cpu_sums_rows_of_broken_families_that_keep_their_weight():
    compare(square(15), 2.015, 64, cut=CUT, broken="redistribute")


@pytest.mark.parametrize("material", [NEO, Woven(MU, 2e5, 160.0), Hasty(MU, 2e5, 160.0)], ids=["neo", "woven", "far"])
def test_a_cpu_sums_rows_of_any_material(material):
    quick, _ = compare(square(11), 2.015, 64, material=material)
    assert "family_rows_force" in quick


@pytest.mark.parametrize("bits", [32, 64])
@pytest.mark.parametrize("torn", [False, True], ids=["undamaged", "torn"])
def test_a_cpu_sums_rows_on_a_curved_sheet(torn, bits):
    tube, forces, energies = small_tube(), [], []
    for fast in (True, False):
        parts = {"damage": CriticalStretch(1e3)} if torn else {}
        built = build(tube, horizon=2.5, material=GENT, precision=bits, law={"fast": fast}, **parts)
        if torn:
            break_at_random(built)
        forces.append(internal_force(built, rough_motion(tube)))
        energies.append(energy_of_families(built, rough_motion(tube)))
    assert np.abs(forces[0] - forces[1]).max() <= TOLERANCE[bits] * np.abs(forces[1]).max()
    assert np.abs(energies[0] - energies[1]).max() <= ENERGY_TOLERANCE[bits] * energies[1].max()


@pytest.mark.parametrize("bits", [32, 64])
@pytest.mark.parametrize("cut", [None, CUT], ids=["undamaged", "torn"])
@pytest.mark.parametrize("sheet", [square(13), jittered(13), square(13).cut((0.0, 0.052), (0.06, 0.052)), holed(19)])
def test_one_thread_per_bond(blocks, sheet, cut, bits):
    """A GPU takes small sheets so."""
    quick, _ = compare(sheet, 3.15 if bits == 64 else 2.015, bits, cut=cut)
    assert quick[-3:-1] == ["family_block_force", "gather_from_reverse_bonds"]


def break_at_random(built, seed=0):
    """Break a tenth of the bonds, seen from one end alone."""
    families = built.law.families
    lost = np.random.default_rng(seed).random(families.exists.shape) < 0.1
    built.law.intact.assign(np.ascontiguousarray(pack(families.exists & ~lost).T))


def compare_softened(sheet, horizon, bits):
    forces, launches = [], []
    for fast in (True, False):
        built = build(sheet, horizon=horizon, precision=bits, law={"fast": fast}, damage=TearingEnergy(10.0))
        soften(built)
        forces.append(internal_force(built, rough(sheet)))
        launches.append(launch_names(built))
    quick, reference = forces
    assert np.abs(quick - reference).max() <= TOLERANCE[bits] * np.abs(reference).max()
    assert launches[0] != launches[1] and "soften_bonds" in launches[0]


def shuffled(points=13):
    """A cloud whose neighbours are far apart in memory."""
    sheet = jittered(points)
    order = np.random.default_rng(1).permutation(sheet.size)
    return Sheet.from_points(sheet.points[order], thickness=1e-3, density=1000.0)


@pytest.mark.parametrize("influence", ["inverse", "inverse_square", lambda r: 1.2 - r])
def test_influence_functions_of_a_cloud(blocks, influence):
    """Named ones are evaluated, others have a table."""
    compare(jittered(13), 2.015, 64, law={"influence": influence})


def test_a_cloud_through_a_ring(monkeypatch, blocks):
    monkeypatch.setattr(fast_path, "CLOUD_RING", 300)
    quick, _ = compare(jittered(33), 2.015, 64)
    assert quick.count("gather_from_reverse_bonds") > 4


def test_indices_that_are_far_apart(monkeypatch, blocks):
    """More than 2^15 points: differences have a second half."""
    sheet = shuffled(183)
    built = build(sheet)
    assert built.law.struct.far == 1 and build(jittered(13)).law.struct.far == 0
    families = built.law.families
    half = array(built, "neighbours").numpy().astype(np.int64) & 0xFFFF
    whole = half + (array(built, "neighbours_high").numpy().astype(np.int64) << 16)
    found = (whole + np.arange(sheet.size)).T
    assert (found == np.where(families.exists, families.neighbours, np.arange(sheet.size)[:, None])).all()


def test_forces_with_indices_that_are_far_apart(monkeypatch, blocks):
    monkeypatch.setattr(family_struct, "NEAR", 5)
    compare(shuffled(), 2.015, 64)


def test_bytes_of_a_cloud(monkeypatch, blocks):
    """At 3.15 a cloud without rupture takes at most 600 bytes a point, and the ring 88 of a million points."""
    built = build(square(101).as_cloud(), horizon=3.15, precision=32, solver=Explicit(duration=1.0))
    points, stored = built.simulation.sheet.size, built.context.fields
    ring = fast_path.CLOUD_RING * built.law.families.members * 12 / 1e6
    assert (stored.nbytes - stored["bond_force"].size * 12) / points + ring <= 600.0
    assert not {"shapes", "bonds", "moments"} & {field.name for field in stored}


def test_laws_that_need_tables_have_them(monkeypatch, blocks):
    cloud = jittered(13)
    assert build(cloud).context.layout.compact == "linear"
    assert build(cloud, law={"fast": False}).context.layout.compact == ""
    assert build(cloud, law={"broken": "redistribute"}).context.layout.compact == ""
    assert build(cloud, solver=Newton()).context.layout.compact == ""
    assert build(cloud, damage=CriticalStretch(1e3)).context.layout.compact == ""
    softening = build(cloud, damage=TearingEnergy(10.0)).context.layout
    assert softening.softening and softening.compact == ""
    assert build(cloud, horizon=3.15).context.layout.compact == "linear"
    monkeypatch.setattr(fast_path, "COMPACT_FROM", cloud.size + 1)
    assert build(cloud, horizon=3.15).context.layout.compact == ""
    assert build(cloud, horizon=2.015).context.layout.compact == "linear"
    assert Visco(NEO).compact == "" and BondAssociated(NEO, influence=lambda r: 1.2 - r).compact == "table"


def test_softened_families():
    compare_softened(square(15), 2.015, 64)


@pytest.mark.parametrize("bits", [32, 64])
@pytest.mark.parametrize("sheet", [square(13), jittered(13)], ids=["lattice", "cloud"])
def test_softened_families_with_one_thread_per_bond(blocks, sheet, bits):
    compare_softened(sheet, 3.15 if bits == 64 else 2.015, bits)


@pytest.mark.parametrize("sheet", [square(13), holed(25, 0.006)], ids=["lattice", "grid"])
def test_softened_families_that_share_blocks(large_on_gpu, sheet):
    compare_softened(sheet, 2.015, 64)


@pytest.mark.parametrize("broken", ["drop", "redistribute"])
@pytest.mark.parametrize("sheet", [square(13), jittered(13), holed(25, 0.006)], ids=["lattice", "cloud", "grid"])
def test_families_that_share_blocks(large_on_gpu, sheet, broken):
    """A GPU takes the damaged and the outer families of large sheets so."""
    quick, _ = compare(sheet, 2.015, 64, cut=CUT, broken=broken)
    assert "family_block_force" in quick and "gather_from_reverse_bonds" in quick


def test_a_large_family(large_on_gpu):
    """In large families, sums run over the members outside an intersection."""
    quick, _ = compare(square(13), 3.15, 64)
    assert "undamaged_family_force" in quick and "family_block_force" in quick


@pytest.mark.parametrize("cut", [None, CUT], ids=["undamaged", "torn"])
@pytest.mark.parametrize("sheet", [square(33), holed(33, 0.006)], ids=["lattice", "grid"])
def test_forces_through_a_ring(monkeypatch, large_on_gpu, sheet, cut):
    """Large sheets are computed in strips; here the ring is small."""
    monkeypatch.setattr(fast_path, "RING", 300)
    monkeypatch.setattr(fast_path, "STRIPS_FROM", 0)
    monkeypatch.setattr(fast_path, "STRIP", 150)
    quick, _ = compare(sheet, 2.015, 64, cut=cut)
    assert quick.count("undamaged_family_force") > 4
    # Where bonds cannot break, the kernel of the forces gathers those of all but the last strips.
    gathers = quick.count("undamaged_family_force") if cut else fast_path.LAG
    assert quick.count("gather_from_reverse_bonds") == gathers


@pytest.mark.parametrize("cut", [None, CUT], ids=["undamaged", "torn"])
def test_bonds_between_distant_indices_need_no_ring(monkeypatch, large_on_gpu, cut):
    """The points off the grid come first, those around them much later."""
    monkeypatch.setattr(fast_path, "RING", 300)
    monkeypatch.setattr(fast_path, "STRIPS_FROM", 0)
    monkeypatch.setattr(fast_path, "STRIP", 150)
    quick, _ = compare(partly_off_the_grid(33), 2.015, 64, cut=cut)
    assert quick.count("undamaged_family_force") == 1


def test_large_families_deep_inside_a_grid(large_on_gpu):
    """In float64, displacements of a large family are read again for each quarter turn."""
    quick, _ = compare(holed(41, 0.006), 3.15, 64)
    assert "undamaged_family_force" in quick and "family_block_force" in quick


def test_the_lists_of_points_are_emptied(large_on_gpu):
    built = build(square(13), damage=CriticalStretch(1e3))
    sever(built, CUT)
    first = internal_force(built, rough(built.simulation.sheet))
    assert (array(built, "other_count").numpy() == 0).all()
    assert (internal_force(built, rough(built.simulation.sheet)) == first).all()
    inner = built.law.families.family_class == built.law.fast_path.stencil[1]
    assert (array(built, "edge_points").numpy() == np.flatnonzero(~inner)).all()
    lost = (built.law.intact.numpy() != pack(built.law.families.exists[built.law.families.family_class]).T).any(axis=0)
    damaged = np.flatnonzero(inner & lost)
    assert len(damaged) > 0 and set(array(built, "damaged_points").numpy()[: len(damaged)]) == set(damaged)


def torn(sheet, horizon, bits, fast, **parts):
    """A sheet that is pulled apart and tears, after 400 steps, with the bits of its bonds at the start."""
    solver = Explicit(duration=0.02)
    built = build(sheet, horizon=horizon, precision=bits, law={"fast": fast}, solver=solver, **parts)
    assert (built.law.fast_path is not None) == fast
    intact = built.law.intact.numpy().copy()
    built.state.velocity.assign(np.column_stack([120.0 * sheet.points[:, 0], 0.0 * sheet.points]))
    internal_force(built, np.zeros((sheet.size, 3)))
    built.state.step.fill_(2e-5)
    built.context.sequence("step", 400).run()
    return built, intact


def compare_torn(sheet, horizon, bits, **parts):
    quick, intact = torn(sheet, horizon, bits, True, **parts)
    reference, _ = torn(sheet, horizon, bits, False, **parts)
    left, moved = quick.law.intact.numpy(), quick.to_numpy(quick.state.displacement)
    assert (left == reference.law.intact.numpy()).all()
    assert (left != intact).any()
    expected = reference.to_numpy(reference.state.displacement)
    assert np.abs(moved - expected).max() < (1e-9 if bits == 64 else 1e-3) * np.abs(expected).max()
    return quick, reference


def test_both_paths_break_the_same_bonds():
    """A sheet that tears breaks the same bonds at the same time on both paths."""
    quick, _ = compare_torn(square(15), 2.015, 64, damage=CriticalStretch(1.5))
    assert "break_bonds" in launch_names(quick)


@pytest.mark.parametrize("tracked", [False, True], ids=["untracked", "tracked"])
@pytest.mark.parametrize("sheet", [square(13), jittered(13), holed(19)], ids=["lattice", "cloud", "grid"])
def test_the_force_breaks_the_same_bonds(blocks, sheet, tracked):
    """On a GPU the kernel of the force breaks bonds, unless the energy that this releases is summed up."""
    quick, reference = compare_torn(
        sheet, 2.015, 64, damage=CriticalStretch(1.5, spared=[0, 1, 2]), track_energy=tracked
    )
    assert ("break_bonds" in launch_names(quick)) == tracked
    if tracked:
        released, expected = (built.rupture.released.numpy() for built in (quick, reference))
        assert expected.max() > 0.0
        assert np.abs(released - expected).max() < 1e-9 * np.abs(expected).max()


@pytest.mark.parametrize("horizon", [2.015, 3.15])
@pytest.mark.parametrize("sheet", [square(17), square((17, 15))], ids=["square", "oblong"])
def test_the_force_of_large_sheets_breaks_the_same_bonds(large_on_gpu, sheet, horizon):
    """The kernel of undamaged families leaves those to the other one in which a bond may break now."""
    quick, _ = compare_torn(sheet, horizon, 64, damage=CriticalStretch(1.5), track_energy=False)
    assert "break_bonds" not in launch_names(quick) and "undamaged_family_force" in launch_names(quick)


def test_scenes_without_fast_kernels():
    assert build(square(15)).law.fast_path is not None
    assert build(square(15), weights="published").law.fast_path is None
    assert build(square(15), law={"fast": False}).law.fast_path is None
    assert build(square(25), horizon=9.5).law.fast_path is None


def test_sheets_without_a_kernel_of_undamaged_families(large_on_gpu):
    assert build(square(15)).law.fast_path.stencil is not None
    assert build(square(15), material=Woven(MU, 2e5, 160.0)).law.fast_path.stencil is None
    assert build(square(15), material=Hasty(MU, 2e5, 160.0)).law.fast_path is None
    assert build(jittered(13)).law.fast_path.stencil is None
    assert build(square(5), horizon=3.15).law.fast_path.stencil is None
