"""The finite elements and the inflated disc are right by themselves, and the stored references are theirs."""

import json
from pathlib import Path

import numpy as np
import pytest
from references import membrane_fe, run, shooting
from scipy.integrate import quad
from scipy.optimize import brentq

STORED = Path(__file__).parents[1] / "references"
SHEET, DISC = (json.loads((STORED / name).read_text()) for name in ("stretch.json", "disc.json"))


# Finite elements ---------------------------------------------------------------------------------------------------


def uniform(quarter, gradient):
    x, y = quarter.grid.components
    places = quarter.grid.basis.doflocs
    displacement = np.zeros(places.shape[1])
    displacement[x], displacement[y] = (gradient[0] @ places)[x], (gradient[1] @ places)[y]
    return displacement


@pytest.mark.parametrize("defect", ["hole", "crack"])
def test_a_uniform_gradient_is_a_patch_without_inner_forces(defect):
    """Curved and graded elements, sheared and stretched: forces arise on the outline alone."""
    quarter = membrane_fe.Quarter(membrane_fe.grid(defect, 3), defect, "planar")
    gradient = np.array([[0.8, 0.3], [-0.1, 0.4]])
    force = quarter.residual(uniform(quarter, gradient))
    x, y = quarter.grid.basis.doflocs
    inside = (x > 1e-9) & (y > 1e-9) & (np.maximum(x, y) < membrane_fe.HALF - 1e-9)
    inside &= (np.hypot(x, y) > membrane_fe.RADIUS + 1e-9) | (defect == "crack")
    assert inside.sum() > 50
    assert np.abs(force[inside]).max() < 1e-13 * np.abs(force).max() * len(force)
    assert np.abs(force).max() > 0.01


@pytest.mark.parametrize("mode", membrane_fe.MODES)
def test_the_sheet_without_a_defect_is_exact(mode):
    quarter = membrane_fe.Quarter(membrane_fe.grid("none", 2), "none", mode)
    quarter.stretch_to(2.0)
    third = {"equibiaxial": 0.25, "planar": 0.5, "uniaxial": 0.5**0.5}[mode]
    exact = membrane_fe.MU * 2.0 * membrane_fe.HALF * membrane_fe.THICKNESS * (2.0 - third**2 / 2.0)
    assert quarter.forces()[0] == pytest.approx(exact, rel=1e-10)


@pytest.mark.parametrize("stiffening", [0.0, 0.085])
def test_stress_is_the_derivative_of_the_energy(stiffening):
    rng = np.random.default_rng(1)
    at = np.eye(2) + 0.3 * rng.normal(size=(2, 2))
    towards, step = rng.normal(size=(2, 2)), 1e-6

    def energy(f):
        first = (f**2).sum() + np.linalg.det(f) ** -2 - 3.0
        return 0.5 * (first + stiffening * first**2)

    slope = (energy(at + step * towards) - energy(at - step * towards)) / (2.0 * step)
    assert (membrane_fe.stress(at, stiffening) * towards).sum() == pytest.approx(slope, rel=1e-8)


@pytest.mark.parametrize("stiffening", [0.0, 0.085])
def test_the_tangent_is_the_derivative_of_the_residual(stiffening):
    quarter = membrane_fe.Quarter(membrane_fe.grid("hole", 2), "hole", "planar", stiffening=stiffening)
    rng = np.random.default_rng(2)
    at = uniform(quarter, np.array([[0.5, 0.2], [0.0, 0.3]]))
    at += 1e-3 * membrane_fe.RADIUS * rng.normal(size=len(at))
    towards, step = membrane_fe.RADIUS * rng.normal(size=len(at)), 1e-6
    slope = (quarter.residual(at + step * towards) - quarter.residual(at - step * towards)) / (2.0 * step)
    matrix = quarter.stiffness(at)
    assert np.abs(matrix @ towards - slope).max() < 1e-7 * np.abs(slope).max()
    assert abs(matrix - matrix.T).max() < 1e-13 * abs(matrix).max()


def test_nodes_of_the_hole_lie_on_its_circle():
    """Of the elements' quadratic edges too, to the power 4 of their size."""
    area = [membrane_fe.HALF**2 - membrane_fe.grid("hole", n).basis.dx.sum() for n in (2, 4, 8)]
    exact = np.pi * membrane_fe.RADIUS**2 / 4.0
    errors = np.abs(np.array(area) / exact - 1.0)
    assert errors[2] < 1e-6
    assert np.log2(errors[:2] / errors[1:]) == pytest.approx(4.0, abs=0.2)


def test_a_clamped_sheet_of_yeohs_material_is_exact():
    quarter = membrane_fe.Quarter(membrane_fe.grid("none", 2), "none", "equibiaxial", "clamp", run.C20 / run.C10)
    quarter.stretch_to(2.0)
    scale = 2.0 * run.C10 / membrane_fe.MU
    first = 2.0 * 2.0**2 + 2.0**-4 - 3.0
    stress = 2.0 * (run.C10 + 2.0 * run.C20 * first) * (2.0 - 2.0**-5)
    assert scale * quarter.forces()[0] == pytest.approx(stress * 0.5 * 0.01, rel=1e-10)


@pytest.mark.parametrize(("defect", "mode"), [("hole", "planar"), ("crack", "planar"), ("inclusion", "equibiaxial")])
def test_coarse_meshes_find_the_stored_force_within_their_own_estimate(defect, mode):
    solved = membrane_fe.converged(defect, mode, (2, 4, 8), [1.5], step=0.25)
    values = solved[1.5]["force_x"]
    stored = SHEET[defect][mode]["1.5"]["force_x"]
    value, error, _ = membrane_fe.richardson(values)
    assert abs(value - stored["value"]) < error < 1e-3 * value
    assert values[-1] == pytest.approx(stored["meshes"][SHEET["meshes"].index(8)], rel=1e-9)


def test_stored_forces_and_openings_are_converged():
    quantities = [
        (defect, name, q)
        for defect in membrane_fe.DEFECTS[1:]
        for mode in ("equibiaxial", "planar")
        for names in SHEET[defect][mode].values()
        for name, q in names.items()
    ]
    assert len(quantities) == 4 * 2 * (4 + 4 + 2)
    for defect, name, q in quantities:
        # The tip of the crack moves by as little as 0.1 mm.
        assert q["error"] < (1e-6 * q["value"] if name.startswith("force") else 1e-6), (defect, name)


def test_stored_forces_of_uniaxial_sheets_are_converged_to_four_digits():
    forces = [q["force_x"] for d in membrane_fe.DEFECTS[1:] for q in SHEET[d]["uniaxial"].values()]
    assert len(forces) == 3 * 4
    assert all(force["error"] < 2e-4 * force["value"] for force in forces)


def test_stored_forces_are_those_of_the_older_elements():
    """Another program, Q9 too, four digits; tests/physics/references/data."""
    older = {
        "equibiaxial": (202.99e3, 301.24e3, 383.71e3, 462.65e3),
        "planar": (176.58e3, 282.81e3, 371.99e3, 455.03e3),
    }
    for mode, forces in older.items():
        stored = [SHEET["hole"][mode][s]["force_x"]["value"] for s in ("1.5", "2", "2.5", "3")]
        assert stored == pytest.approx(forces, rel=3e-5)


def test_the_limit_of_a_known_order_is_found():
    values = [7.0 + 3.0 * h**3.5 for h in (0.4, 0.2, 0.1)]
    limit, error, order = membrane_fe.richardson(values)
    assert limit == pytest.approx(7.0, rel=1e-12)
    assert order == pytest.approx(3.5)
    assert error == pytest.approx(abs(values[-1] - 7.0), rel=1e-3)
    assert membrane_fe.richardson([1.0, 2.0, 4.0])[:2] == pytest.approx((4.0, 2.0))


# The inflated disc -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize("name", run.MATERIALS)
def test_the_disc_finds_its_stored_curve(name):
    for stored in DISC[name]["curve"][::3]:
        disc = shooting.at_stretch(stored["stretch"], run.MATERIALS[name])
        assert stored["error"] < 1e-8
        for quantity in ("pressure", "deflection", "volume", "energy"):
            assert getattr(disc, quantity) == pytest.approx(stored[quantity], rel=1e-9), quantity


def test_the_disc_under_a_pressure_is_found_again_on_both_branches():
    for place, bracket in ((5, (1.0001, 2.0)), (9, (2.3, 5.0))):
        stored = DISC["neo-Hookean"]["curve"][place]
        disc = shooting.inflated_disc(stored["pressure"], bracket=bracket)
        assert disc.stretch == pytest.approx(stored["stretch"], rel=1e-9)
        assert disc.deflection == pytest.approx(stored["deflection"], rel=1e-9)


def test_the_pressure_of_the_disc_has_its_maximum():
    stored = DISC["neo-Hookean"]["maximum"]
    assert shooting.maximum().pressure == pytest.approx(stored["pressure"], rel=1e-9)
    for stretch in (0.98, 1.02):
        assert shooting.at_stretch(stretch * stored["stretch"]).pressure < stored["pressure"]
    with pytest.raises(ValueError, match="no maximum"):
        shooting.maximum(run.MATERIALS["Mooney-Rivlin"])


@pytest.mark.parametrize("name", run.MATERIALS)
def test_the_pressure_is_the_derivative_of_the_energy_by_the_volume(name):
    """Energy plays no part in the equations that are integrated: an error of theirs would show here."""
    for stretch in (1.1, 1.5, 2.0, 3.0):
        low, high = (shooting.at_stretch(stretch + d * (stretch - 1.0), run.MATERIALS[name]) for d in (-3e-4, 3e-4))
        middle = shooting.at_stretch(stretch, run.MATERIALS[name]).pressure
        assert (high.energy - low.energy) / (high.volume - low.volume) == pytest.approx(middle, rel=2e-7)


def hencky(ratio, terms=60):
    """Deflection over R (p R/(E h))^(1/3) of Hencky's small-strain disc, a power series, and its first coefficient."""

    def series(first):
        b, c = np.zeros(terms), np.zeros(terms)
        b[0], c[0] = first, -8.0 / first**2
        b[1] = c[0] / 8.0
        for k in range(1, terms - 1):
            squares = np.array([b[: m + 1] @ b[m::-1] for m in range(k + 1)])
            c[k] = -(c[:k] @ squares[k:0:-1]) / squares[0]
            b[k + 1] = c[k] / (4.0 * (k + 1) * (k + 2))
        return b

    first = brentq(lambda b: series(b) @ (1.0 - ratio + 2.0 * np.arange(terms)), 1.4, 2.5)
    tension = series(first)[::-1]
    return quad(lambda r: 2.0 * r / np.polyval(tension, r**2), 0.0, 1.0)[0], first


def test_a_disc_under_little_pressure_is_henckys():
    """Incompressible: Poisson's ratio 1/2, E = 3 mu. The difference is of first order in the strain."""
    assert [hencky(ratio)[1] for ratio in (0.2, 0.3, 0.4)] == pytest.approx([1.6827, 1.7244, 1.7769], abs=1e-4)
    exact, _ = hencky(0.5)
    errors = []
    for strain in (1e-3, 1e-4):
        disc = shooting.at_stretch(1.0 + strain)
        errors.append(disc.deflection / (disc.pressure / 3.0) ** (1.0 / 3.0) / exact - 1.0)
    assert abs(errors[1]) < 2e-4
    assert errors[0] / errors[1] == pytest.approx(10.0, rel=0.02)


def test_the_profile_runs_from_the_top_to_the_rim():
    disc = shooting.inflated_disc(1.0)
    r = np.linspace(0.0, 1.0, 201)
    radius, height = disc.profile(r)
    assert height[0] == pytest.approx(disc.deflection, rel=1e-9)
    assert (radius[0], radius[-1], height[-1]) == pytest.approx((0.0, 1.0, 0.0), abs=1e-9)
    assert np.pi * np.trapezoid(radius**2, -height) == pytest.approx(disc.volume, rel=1e-4)
    with pytest.raises(ValueError, match="expected a stretch above 1"):
        shooting.at_stretch(1.0)
