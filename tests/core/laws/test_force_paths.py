"""Force paths of the bond-associated law agree with the reference on random states with damage."""

import numpy as np
import pytest
from curved_sheets import rough_motion, small_tube, tear
from grid_sheets import holed, partly_off_the_grid
from helpers import GENT, MU, NEO, array, build, internal_force, jittered, sever, soften, square, strain_energy

from warp_pd import CriticalStretch, Explicit, Gent, TearingEnergy
from warp_pd.device.checks import InputError
from warp_pd.families import pack
from warp_pd.fast.force_paths import ALIGNED, TUNING, strips_of
from warp_pd.laws import weight_tables
from warp_pd.run.result import plan

TOLERANCE = {32: 2e-6, 64: 1e-12}
# An energy is of second order in a strain that float32 knows to 1e-6 of one.
ENERGY_TOLERANCE = {32: 1e-5, 64: 1e-12}
CUT = ((0.02, 0.031), (0.071, 0.08))
# Families of 20: the least with the path of a large family (kernels/fast/stencil.py); those of 3.15 compile longer.
LARGE = 2.3


class Woven(Gent):
    """A material that does not claim to be isotropic."""

    isotropic = False


class Hasty(Gent):
    """A material whose stress does not start from a guess."""

    near = None


@pytest.fixture
def large_on_gpu(gpu_paths, tune):
    """The path of a large sheet on a GPU, with small sheets on a CPU."""
    tune(lattice_bonds=0)


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


def cut_through(built):
    sever(built, CUT)


def compare(sheet, horizon, bits, tear=None, damage=None, material=NEO, law=None):
    """Forces and energies of the fast and the reference kernels, after `tear` broke or weakened bonds; the launches."""
    damage = damage or (CriticalStretch(1e3) if tear else None)
    move = rough(sheet) if sheet.frames is None else rough_motion(sheet)
    forces, energies, launches = [], [], []
    for fast in (True, False):
        built = build(
            sheet, horizon=horizon, material=material, precision=bits, law={"fast": fast, **(law or {})}, damage=damage
        )
        if tear:
            tear(built)
        forces.append(internal_force(built, move))
        energies.append(energy_of_families(built, move))
        launches.append(launch_names(built))
    quick, reference = forces
    assert np.abs(quick - reference).max() <= TOLERANCE[bits] * np.abs(reference).max()
    assert np.abs(energies[0] - energies[1]).max() <= ENERGY_TOLERANCE[bits] * energies[1].max()
    return launches


def test_undamaged_families_inside_a_lattice(large_on_gpu):
    quick, reference = compare(square(15), 2.015, 32, material=GENT)
    assert {"undamaged_family_force", "family_block_force"} <= set(quick)
    assert "variational_force" in reference


def test_undamaged_families_inside_a_lattice_whose_spacings_differ(large_on_gpu):
    quick, _ = compare(square((17, 15)), LARGE, 32, cut_through)
    assert "undamaged_family_force" in quick


SLIT = square(13).cut((0.0, 0.052), (0.06, 0.052))


def break_at_random(built, seed=0):
    """Break a tenth of the bonds, seen from one end alone."""
    families = built.law.families
    lost = np.random.default_rng(seed).random(families.exists.shape) < 0.1
    built.law.intact.assign(np.ascontiguousarray(pack(families.exists & ~lost).T))


@pytest.mark.parametrize(
    ("sheet", "horizon", "bits", "tear"),
    [
        (square(15), 1.5, 32, None),
        (square(15), 3.15, 64, cut_through),
        (jittered(13), 1.8, 64, cut_through),
        (SLIT, 3.15, 64, cut_through),
        (holed(19), 1.5, 64, cut_through),
        (small_tube(), 2.5, 32, None),
        (small_tube(), 2.5, 64, break_at_random),
    ],
    ids=["lattice", "torn lattice", "torn cloud", "torn slit", "torn grid", "tube", "torn tube"],
)
def test_a_cpu_sums_rows(sheet, horizon, bits, tear):
    quick, reference = compare(sheet, horizon, bits, tear)
    assert "family_rows_force" in quick and "family_rows_force" not in reference


@pytest.mark.parametrize("material", [NEO, Woven(MU, 2e5, 160.0), Hasty(MU, 2e5, 160.0)], ids=["neo", "woven", "far"])
def test_a_cpu_sums_rows_of_any_material(material):
    quick, _ = compare(square(11), 2.015, 64, material=material)
    assert "family_rows_force" in quick


def test_torn_families_of_a_curved_sheet_share_blocks(large_on_gpu):
    quick, _ = compare(small_tube(), 2.5, 64, tear)
    assert "family_block_force" in quick


@pytest.mark.parametrize("sheet", [square(13), jittered(13), holed(19)], ids=["lattice", "cloud", "grid"])
def test_one_thread_per_bond(gpu_paths, sheet):
    """A GPU takes small sheets so."""
    quick, _ = compare(sheet, 2.015, 64, cut_through)
    assert "family_block_force" in quick and "undamaged_family_force" not in quick


@pytest.mark.parametrize(
    ("sheet", "horizon", "bits", "tear"),
    [
        (jittered(13), 3.15, 32, None),
        (jittered(13), 2.015, 64, cut_through),
        (holed(19), 2.015, 64, cut_through),
        (small_tube(), 2.5, 64, tear),
    ],
    ids=["cloud", "torn cloud", "torn grid", "torn tube"],
)
def test_four_bonds_per_thread(gpu_paths, tune, sheet, horizon, bits, tear):
    """A GPU takes large sheets so."""
    tune(block_bonds=0)
    quick, _ = compare(sheet, horizon, bits, tear)
    assert "family_block_force" in quick


def compare_softened(sheet, bits):
    quick, reference = compare(sheet, 2.015, bits, soften, TearingEnergy(10.0))
    assert quick != reference and "sweep" in quick


def test_softened_families():
    compare_softened(square(15), 64)


def test_softened_families_with_one_thread_per_bond(gpu_paths):
    compare_softened(jittered(13), 64)


def test_softened_families_that_share_blocks(large_on_gpu):
    compare_softened(square(13), 64)


@pytest.mark.parametrize("sheet", [square(13), holed(25, 0.006)], ids=["lattice", "grid"])
def test_families_that_share_blocks(large_on_gpu, sheet):
    """A GPU takes the damaged and the outer families of large sheets so."""
    quick, _ = compare(sheet, 2.015, 64, cut_through)
    assert "family_block_force" in quick and "gather_from_reverse_bonds" in quick


def test_forces_through_a_ring(large_on_gpu, tune):
    """Large sheets are computed in strips; here the ring is small."""
    tune(ring=300)
    quick, _ = compare(holed(33, 0.006), 2.015, 64, cut_through)
    assert quick.count("undamaged_family_force") == quick.count("gather_from_reverse_bonds") > 4


def test_bonds_between_distant_indices_need_no_ring(large_on_gpu, tune):
    """The points off the grid come first, those around them much later."""
    tune(ring=300)
    quick, _ = compare(partly_off_the_grid(33), 2.015, 64, cut_through)
    assert quick.count("undamaged_family_force") == 1


def test_strips_have_the_bits_of_a_whole_sheet(large_on_gpu, tune):
    sheet, results = square(25), []
    for ring in (250, 10**9):
        tune(ring=ring)
        built = build(sheet, damage=CriticalStretch(1.1))
        built.state.velocity.assign(np.column_stack([60.0 * sheet.points[:, 0], 0.0 * sheet.points]))
        internal_force(built, rough(sheet))
        built.state.step.fill_(2e-5)
        built.context.sequence("step", 3).run()
        results.append({name: array.numpy().tobytes() for name, array in built.context.fields.in_restart().items()})
    assert results[0] == results[1]


def test_strips_take_little_memory(large_on_gpu, tune):
    tune(ring=201 * 20)
    solver = Explicit(1.0, retries=0)  # whose copy of the last frame is none of the forces
    stored = build(square(201), horizon=3.15, material=GENT, precision=32, solver=solver).context.fields
    assert stored.nbytes < 200 * 201**2


@pytest.mark.parametrize(("points", "ring"), [(1000, 57), (1000, 100), (999, 101), (1001, 250), (2000, 256)])
def test_strips_cover_a_sheet_once(points, ring):
    here, reach = slice(3, points - 5), 10
    strips = strips_of(here, points, reach, ring)
    step = np.gcd(ring, ALIGNED)
    assert len(strips) > 1 and all(strip.end % step == strip.gather_end % step == 0 for strip in strips[:-1])
    # A strip overwrites in the ring only what has been gathered, and leaves little of it.
    assert all(strip.end - strip.gather_begin + reach <= ring for strip in strips)
    assert all(strip.end - strip.begin > ring - 2 * reach - 2 * step for strip in strips[1:-1])
    computed = np.concatenate([np.arange(strip.begin, strip.end) for strip in strips])
    assert (computed == np.arange(here.start, here.stop)).all()
    gathered = np.concatenate([np.arange(strip.gather_begin, strip.gather_end) for strip in strips])
    assert (gathered == np.arange(points)).all()
    assert all(strip.gather_end + reach <= strip.end for strip in strips[:-1])


def test_sheets_of_few_strips_or_distant_bonds_are_whole():
    assert len(strips_of(slice(0, 400), 400, 20, 200)) == 1 == len(strips_of(slice(0, 1000), 1000, 80, 200))


def test_tables_with_too_many_entries_are_refused(monkeypatch):
    monkeypatch.setattr(weight_tables, "MAX_ENTRIES", 1000)
    with pytest.raises(InputError, match=r"^169 families of up to \d+ members: expected fewer than 2\^32 entries"):
        build(jittered(13))


def test_large_families_deep_inside_a_grid(large_on_gpu):
    """In float64, displacements of a large family are read again for each quarter turn.

    Sums run over the members outside an intersection.
    """
    quick, _ = compare(holed(33, 0.006), LARGE, 64)
    assert "undamaged_family_force" in quick and "family_block_force" in quick


def test_the_list_of_other_families_is_emptied(large_on_gpu):
    built = build(square(13), damage=CriticalStretch(1e3))
    sever(built, CUT)
    first = internal_force(built, rough(built.simulation.sheet))
    assert (array(built, "other_count").numpy() == 0).all()
    assert (internal_force(built, rough(built.simulation.sheet)) == first).all()
    families = built.law.families
    lost = (built.law.intact.numpy() != pack(families.exists[families.family_class]).T).any(axis=0)
    others = np.flatnonzero(lost | (families.family_class != built.law.path.inner))
    assert lost.any() and set(array(built, "other_points").numpy()[: len(others)]) == set(others)


def torn(sheet, horizon, bits, fast, **parts):
    """A sheet that is pulled apart and tears, after 400 steps, with the bits of its bonds at the start."""
    solver = Explicit(duration=0.02)
    built = build(sheet, horizon=horizon, precision=bits, law={"fast": fast}, solver=solver, **parts)
    assert (built.law.force_path != "reference") == fast
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


def test_rows_break_the_same_bonds():
    """A sheet that tears breaks the same bonds at the same time on every path."""
    compare_torn(square(15), 2.015, 64, damage=CriticalStretch(1.5))


@pytest.mark.parametrize("sheet", [square(13), jittered(13), holed(19)], ids=["lattice", "cloud", "grid"])
def test_blocks_break_the_same_bonds(gpu_paths, sheet):
    quick, reference = compare_torn(sheet, 2.015, 64, damage=CriticalStretch(1.5, spared=[0, 1, 2]))
    released, expected = (built.rupture.released.numpy() for built in (quick, reference))
    assert expected.max() > 0.0
    assert np.abs(released - expected).max() < 1e-9 * np.abs(expected).max()


def test_large_sheets_break_the_same_bonds(large_on_gpu):
    """Families that lose bonds join the others."""
    quick, _ = compare_torn(square(17), 2.015, 64, damage=CriticalStretch(1.5))
    assert "undamaged_family_force" in launch_names(quick)


def test_scenes_on_the_reference_path():
    assert build(square(15)).law.force_path == "rows"
    assert build(square(15), weights="published").law.force_path == "reference"
    assert build(square(15), law={"fast": False}).law.force_path == "reference"
    assert build(square(25), horizon=9.5).law.force_path == "reference"


def test_a_gpu_takes_the_first_path_that_applies(large_on_gpu, tune):
    assert build(square(15)).law.force_path == "undamaged lattice"
    assert build(square(15), material=Woven(MU, 2e5, 160.0)).law.force_path == "blocks"
    assert build(square(15), material=Hasty(MU, 2e5, 160.0)).law.force_path == "reference"
    assert build(jittered(13)).law.force_path == "blocks"
    assert build(square(5), horizon=3.15).law.force_path == "blocks"
    tune(lattice_bonds=TUNING.lattice_bonds)
    assert build(square(15)).law.force_path == "blocks"


def test_the_plan_names_the_path():
    assert "force = BondAssociated: rows\n" in plan(build(square(15)))
