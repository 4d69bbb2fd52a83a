"""Fields that laws show in frames: stretches, stresses, direction, wrinkle state, bonds, against exact states."""

import numpy as np
import pytest
import warp as wp
from bond_based_cases import built as pairwise
from curved_sheets import rotation, small_sphere, small_tube
from grid_sheets import holed
from helpers import NEO, array, build, exact_stress, jittered, refused, sever, square, uniform
from point_laws import build as build_law
from visco_laws import POLYUREA, TERMS

from warp_pd import (
    BondAssociated,
    BondNeoHookean,
    CriticalStretch,
    Explicit,
    Fixed,
    HyperelasticBonds,
    Material,
    MooneyRivlin,
    Motion,
    Neural,
    Newton,
    Nodal,
    Relaxation,
    Sheet,
    Simulation,
    TensionField,
    Visco,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.kernels.tension_field import SLACK, TAUT, WRINKLED

ALL = ("stretch", "direction", "first_piola", "cauchy", "wrinkle_state", "bonds")
STRAINS = ("stretch", "direction", "bonds")
TOLERANCE = {64: 1e-11, 32: 1e-5}
# Of a GPU over that of a CPU.
WIDER = {"cpu": 1, "cuda:0": 10}
GRADIENTS = {
    "uniaxial": np.diag([1.7, 1.7**-0.5]),
    "equibiaxial": np.diag([1.4, 1.4]),
    "simple shear": np.array([[1.0, 0.8], [0.0, 1.0]]),
    "turned in space": rotation()[:, :2] @ np.array([[1.6, 0.3], [0.3, 1.1]]),
}


def ring():
    return Sheet.outline(
        [(0.0, 0.0), (0.1, 0.0), (0.12, 0.08), (0.03, 0.1)], spacing=8e-3, thickness=1e-3, density=1000.0
    )


SHEETS = {
    "lattice": lambda: square(11),
    "cloud": lambda: jittered(11),
    "cut": lambda: square(13).cut((0.02, 0.052), (0.07, 0.061)),
    "grid": lambda: holed(25),
    "outline": ring,
}


def in_space(F):
    return np.vstack([F, np.zeros((1, 2))]) if len(F) == 2 else F


def moved(built, displacement):
    """Values of every shown field at a displacement."""
    built.state.displacement.assign(displacement.astype(built.state.displacement.numpy().dtype))
    built.context.run("setup")
    built.context.run("frame")
    return {s.field.output: s.array.numpy() for s in built.context.fields.shown()}


def require_exact(shown, F, P=None, J=None, tolerance=1e-11, points=slice(None)):
    """Compare stretches, direction and stresses with those of a uniform gradient, and first Piola stress."""
    left, stretches, right = np.linalg.svd(in_space(F))
    for k in (0, 1):
        assert shown[f"stretch_{k + 1}"][points] == pytest.approx(stretches[k], rel=tolerance)
    if stretches[0] - stretches[1] > 1e-3:
        assert np.abs(shown["stretch_direction"][points] @ left[:, 0]) == pytest.approx(1.0, abs=10 * tolerance)
    if P is not None:
        axes = left[:, :2].T @ in_space(P) @ right.T
        assert np.abs(axes - np.diag(np.diag(axes))).max() < 1e-6 * np.abs(axes).max()
        largest = np.abs(axes).max()
        for k in (0, 1):
            assert shown[f"first_piola_{k + 1}"][points] == pytest.approx(
                axes[k, k], rel=tolerance, abs=tolerance * largest
            )
            if J is not None:
                cauchy = axes[k, k] * stretches[k] / J
                assert shown[f"cauchy_{k + 1}"][points] == pytest.approx(cauchy, rel=tolerance, abs=tolerance * largest)


def volume_ratio(F):
    """J of the neo-Hookean sheet: sigma_33 = 0 solved for the thickness stretch."""
    from scipy.optimize import brentq

    C = F.T @ F
    area = np.sqrt(np.linalg.det(C))

    def across(l3):
        J = area * l3
        deviator = NEO.mu * J ** (-5 / 3) * (l3**2 - (np.trace(C) + l3**2) / 3.0)
        return deviator + 0.25 * NEO.bulk * (J - J**-3)

    return area * brentq(across, 0.05, 20.0, xtol=1e-15)


def mooney_rivlin(material, F):
    """First Piola stress of an incompressible sheet, by its energy's derivatives."""
    l1, l2 = np.linalg.svd(F)[1]
    left, _, right = np.linalg.svd(in_space(F))

    def principal(a, b):
        # Psi = c10 (I1 - 3) + c01 (I2 - 3) with l3 = 1 / (a b); derivative by a.
        return 2.0 * (a - 1.0 / (a**3 * b**2)) * (material.c10 + material.c01 * b**2)

    return left[:, :2] @ np.diag([principal(l1, l2), principal(l2, l1)]) @ right


# Uniform states -----------------------------------------------------------------------------------------


@pytest.mark.parametrize(("sheet", "precision"), [*((name, 64) for name in SHEETS), ("lattice", 32)])
def test_uniform_states_are_exact_at_every_point(sheet, precision, device):
    sheet, tolerance = SHEETS[sheet](), WIDER[device] * TOLERANCE[precision]
    built = build(sheet, precision=precision, fields=ALL, device=device)
    for name, F in GRADIENTS.items():
        shown = moved(built, uniform(sheet, in_space(F)))
        require_exact(shown, F, exact_stress(NEO, F), volume_ratio(F), tolerance)
        # Both are narrower than in uniaxial tension: "uniaxial", as the material is slightly compressible.
        assert (shown["wrinkle_state"] == (WRINKLED if name in ("uniaxial", "simple shear") else TAUT)).all()
    assert (shown["broken_bonds"] == 0).all() and shown["intact_bonds"].sum() == built.law.families.bond_count


@pytest.mark.parametrize("weights", ["published", "corrected"])
def test_weights_change_nothing_of_a_uniform_state(weights):
    sheet, F = square(11), GRADIENTS["simple shear"]
    require_exact(
        moved(build(sheet, weights=weights, fields=ALL), uniform(sheet, in_space(F))), F, exact_stress(NEO, F),
        volume_ratio(F),
    )  # fmt: skip


@pytest.mark.parametrize("precision", [64, 32])
def test_the_sheet_without_load_shows_nothing(precision):
    shown = moved(build(square(9), precision=precision, fields=ALL), np.zeros((81, 3)))
    for name in ("first_piola_1", "first_piola_2", "cauchy_1", "cauchy_2", "wrinkle_state"):
        assert (shown[name] == 0.0).all()
    assert (shown["stretch_1"] == 1.0).all() and (shown["stretch_2"] == 1.0).all()


def test_stiff_parts_carry_more_at_the_same_stretch():
    F, half = GRADIENTS["uniaxial"], square(11).where(lambda x, y: x > 0.05)
    sheet = square(11).stiffened(half, 4.0)
    shown = moved(build(sheet, fields=ALL), uniform(sheet, in_space(F)))
    soft = np.setdiff1d(np.arange(sheet.size), half)
    require_exact(shown, F, exact_stress(NEO, F), volume_ratio(F), points=soft)
    require_exact(shown, F, 4.0 * exact_stress(NEO, F), volume_ratio(F), points=np.asarray(half))


def test_a_prestretched_sheet_shows_the_stretch_it_was_clamped_with():
    sheet = square(11).prestretched(1.3, 1.1)
    result = Simulation(
        sheet, BondAssociated(NEO), Newton(load_steps=1), loads=[Fixed(sheet.edges("all"))], fields=("stretch",)
    ).run(device="cpu")
    assert result.frame.point_data["stretch_1"] == pytest.approx(1.3, rel=1e-9)
    assert result.frame.point_data["stretch_2"] == pytest.approx(1.1, rel=1e-9)


# Curved sheets ------------------------------------------------------------------------------------------


def test_an_inflated_sphere_has_the_exact_stretch_and_stress(device):
    sheet, material = small_sphere(8), MooneyRivlin(2e5, 1e4)
    built = build(sheet, material=material, fields=ALL, device=device)
    F = 1.5 * np.eye(2)
    shown = moved(built, 0.5 * sheet.points)
    require_exact(shown, F, mooney_rivlin(material, F), 1.0, 20 * TOLERANCE[64])
    at_rest = moved(built, np.zeros((sheet.size, 3)))
    assert (at_rest["stretch_1"] == 1.0).all() and (at_rest["first_piola_1"] == 0.0).all()


def test_directions_on_a_tube_are_tangents_along_the_largest_stretch():
    sheet = small_tube(32)
    built = build(sheet, material=MooneyRivlin(2e5), fields=ALL)
    shown = moved(built, sheet.points * [0.4, 0.4, 0.0])
    around = np.cross([0.0, 0.0, 1.0], sheet.points * [1.0, 1.0, 0.0])
    assert np.abs((shown["stretch_direction"] * around).sum(axis=1)) == pytest.approx(1.0, abs=1e-3)
    middle = np.abs(sheet.points[:, 2] - sheet.points[:, 2].mean()) < 0.3
    assert shown["stretch_1"][middle] == pytest.approx(1.4, rel=1e-3)
    along = moved(built, sheet.points * [0.0, 0.0, 0.2])["stretch_direction"]
    assert np.abs(along[middle, 2]) == pytest.approx(1.0, abs=1e-9)


# Wrinkles -----------------------------------------------------------------------------------------------


def test_a_wrinkled_patch_carries_uniaxial_stress_and_says_so(device):
    sheet, material = jittered(9), MooneyRivlin(2e5)
    built = build(sheet, material=TensionField(material), fields=ALL, device=device)
    tolerance = 10 * TOLERANCE[64]
    turn = rotation()
    for l1, l2, state in ((1.5, 0.6, WRINKLED), (0.9, 0.8, SLACK), (1.5, 1.2, TAUT), (1.5, 1.5**-0.5, TAUT)):
        F = turn[:, :2] @ np.diag([l1, l2])
        shown = moved(built, uniform(sheet, F))
        assert (shown["wrinkle_state"] == state).all()
        P = {
            WRINKLED: [4e5 * (l1 - l1**-2), 0.0],
            SLACK: [0.0, 0.0],
            TAUT: [4e5 * (l1 - l1**-3 * l2**-2), 4e5 * (l2 - l2**-3 * l1**-2)],
        }[state]
        for k, stretch in enumerate((l1, l2)):
            assert shown[f"first_piola_{k + 1}"] == pytest.approx(P[k], rel=tolerance, abs=4e5 * tolerance)
            # The sheet itself is as wide as in uniaxial tension: its volume stays, whatever its fold.
            assert shown[f"cauchy_{k + 1}"] == pytest.approx(P[k] * stretch, rel=tolerance, abs=4e5 * tolerance)


def test_without_tension_field_the_signs_of_the_stresses_say_whether_it_would_wrinkle():
    sheet = square(9)
    built = build(sheet, fields=("wrinkle_state",))
    for stretches, state in (((1.5, 0.6), WRINKLED), ((0.9, 0.9), SLACK), ((1.2, 1.2), TAUT), ((1.0, 1.0), TAUT)):
        shown = moved(built, uniform(sheet, in_space(np.diag(stretches))))
        assert (shown["wrinkle_state"] == state).all()


# Torn sheets --------------------------------------------------------------------------------------------


def test_broken_bonds_leave_the_stress_of_what_is_left(device):
    sheet, F = jittered(13), GRADIENTS["simple shear"]
    built = build(sheet, damage=CriticalStretch(9.0), fields=ALL, device=device)
    lost = sever(built, ((0.02, 0.048), (0.07, 0.062))) & built.law.families.exists
    assert lost.any()
    shown = moved(built, uniform(sheet, in_space(F)))
    known = np.isfinite(shown["stretch_1"])
    assert known.mean() > 0.95
    require_exact(shown, F, exact_stress(NEO, F), volume_ratio(F), WIDER[device] * TOLERANCE[64], known)
    assert (shown["broken_bonds"] == lost.sum(axis=1)).all()
    assert (shown["intact_bonds"] == (built.law.families.exists & ~lost).sum(axis=1)).all()


@pytest.mark.parametrize("law", ["bond_associated", "nodal"])
def test_a_point_without_bonds_has_no_stretch_and_carries_nothing(law):
    force = BondAssociated(NEO) if law == "bond_associated" else Nodal(NEO)
    sheet = square(9)
    built = build_law(sheet, force, damage=CriticalStretch(9.0), fields=ALL)
    bits = built.law.intact.numpy()
    bits[:, 40] = 0
    built.law.intact.assign(bits)
    shown = moved(built, uniform(sheet, in_space(GRADIENTS["uniaxial"])))
    assert np.isnan(shown["stretch_1"][40]) and np.isnan(shown["stretch_direction"][40]).all()
    assert shown["first_piola_1"][40] == 0.0 and shown["cauchy_2"][40] == 0.0 and shown["intact_bonds"][40] == 0
    assert shown["wrinkle_state"][40] == SLACK
    assert np.isfinite(np.delete(shown["stretch_1"], 40)).all()


# Other laws ---------------------------------------------------------------------------------------------


def test_nodal_shows_its_own_stress(device):
    sheet, F = jittered(13), GRADIENTS["turned in space"]
    shown = moved(build_law(sheet, Nodal(NEO), device=device, fields=ALL), uniform(sheet, F))
    require_exact(shown, F, exact_stress(NEO, F), volume_ratio(F), WIDER[device] * TOLERANCE[64])


def test_a_viscous_sheet_shows_the_instantaneous_stress_after_a_jump():
    sheet, F = square(9), GRADIENTS["uniaxial"]
    start = uniform(sheet, in_space(F))
    law = Visco(POLYUREA, horizon=2.015, prony=TERMS)
    built = Simulation(sheet, law, Explicit(1.0), initial_displacement=start, fields=ALL).build("cpu", 64)
    built.context.run("start")
    shown = moved(built, start)
    at_once = Yeoh(c10=POLYUREA.c10 + 0.15e6, c20=POLYUREA.c20 + 0.01e6)
    elastic = moved(build(sheet, material=at_once, fields=ALL), start)
    for name in ("first_piola_1", "first_piola_2", "cauchy_1"):
        assert shown[name] == pytest.approx(elastic[name], rel=1e-9, abs=1e-6)


PAIRWISE = {
    "bond-based": lambda sheet: pairwise(sheet, fields=STRAINS),
    "hyperelastic": lambda sheet: build_law(
        sheet, HyperelasticBonds(BondNeoHookean(1e3, "uniaxial", "refitted")), fields=STRAINS
    ),
    "neural": lambda sheet: build_law(sheet, Neural(NEO, evaluation="closed_form"), fields=STRAINS),
    "visco bonds": lambda sheet: build_law(sheet, ViscoBondBased(POLYUREA, horizon=2.015), fields=STRAINS),
}


@pytest.mark.parametrize("law", PAIRWISE)
def test_laws_without_a_gradient_show_that_of_the_family(law):
    sheet, F = square(13), GRADIENTS["turned in space"]
    built = PAIRWISE[law](sheet)
    shown = moved(built, uniform(sheet, F))
    require_exact(shown, F)
    assert shown["intact_bonds"].sum() == built.law.families.bond_count


def test_pairwise_laws_show_the_stretch_of_a_curved_sheet():
    sheet = small_sphere(8)
    shown = moved(pairwise(sheet, horizon=2.015, fields=STRAINS), 0.5 * sheet.points)
    assert shown["stretch_1"] == pytest.approx(1.5, rel=1e-10)


# Equilibrium, cost and wrong input ----------------------------------------------------------------------


@pytest.mark.parametrize("solver", [Newton(load_steps=2), Relaxation(load_steps=2)], ids=["newton", "relaxation"])
def test_frames_in_equilibrium_hold_the_fields(solver):
    sheet = square(11)
    result = Simulation(
        sheet,
        BondAssociated(NEO, weights="corrected"),
        solver,
        loads=[
            Fixed(range(sheet.size), "z"),
            Fixed(sheet.edges("left"), "x"),
            Fixed(sheet.edges("bottom"), "y"),
            Motion(sheet.edges("right"), times=[0.0, 1.0], x=[0.0, 0.05]),
        ],
        fields=ALL,
    ).run(device="cpu")
    shown = result.frame.point_data
    # Free to contract: uniaxial tension, exactly uniform with corrected weights.
    tolerance = 1e-3
    assert shown["stretch_1"] == pytest.approx(1.5, rel=tolerance)
    assert np.abs(shown["first_piola_2"]).max() < tolerance * shown["first_piola_1"].max()
    ratio = volume_ratio(np.diag([shown["stretch_1"].mean(), shown["stretch_2"].mean()]))
    assert shown["cauchy_1"] == pytest.approx(1.5 * shown["first_piola_1"] / ratio, rel=tolerance)
    assert result.frame.point_data["strain_energy_density"].min() > 0.0


def test_fields_left_out_leave_no_array_and_no_launch():
    sheet = square(9)
    without, asked = build(sheet), build(sheet, fields=ALL)
    names = {stored.name for stored in without.context.fields}
    added = {stored.name for stored in asked.context.fields} - names
    values = {f"{name}_{k}" for name in ("stretch", "first_piola", "cauchy") for k in (1, 2)}
    assert added == {*values, "stretch_direction", "wrinkle_state", "intact_bonds", "broken_bonds"}
    launches = [{name: len(list(s.launches())) for name, s in b.context.stages.items()} for b in (without, asked)]
    assert launches[1].pop("frame") == launches[0].pop("frame") + 2
    assert launches[0] == launches[1]
    one = build(sheet, fields=("stretch_2",))
    assert {stored.name for stored in one.context.fields} - names == {"stretch_1", "stretch_2"}
    assert wp.types.type_size_in_bytes(array(build(sheet, precision=32, fields=("stretch",)), "stretch_1").dtype) == 4


class Plain:
    """A material with stress and energy alone."""

    constants, functions = NEO.constants, staticmethod(NEO.functions)


def test_what_a_law_cannot_give_is_refused_in_one_line():
    plain: Material = Plain()
    for make, said in (
        (
            lambda: pairwise(square(9), fields=("cauchy",)),
            "the law BondBased has no such field; expected one of principal_stress, wrinkle_level, stretch, direction, "
            "bonds",
        ),
        (lambda: build(square(9), fields=("strech",)), "did you mean 'stretch'"),
        (
            lambda: build(square(9), material=plain, fields=("cauchy",)),
            "has no such field; expected one of stretch, direction, first_piola",
        ),
        (lambda: build(square(9), fields=("principal_stress",)), "fields = 'principal_stress'"),
    ):
        with refused(said):
            make()
