"""The field `strain_energy_density` against the energy density of uniform states, at every point."""

import numpy as np
import pytest
from bond_based_cases import LAWS
from bond_based_cases import E as YOUNG
from bond_based_cases import built as pairwise
from curved_sheets import rotation, small_sphere
from grid_sheets import holed
from helpers import array, build, jittered, sever, soften, square, uniform
from point_laws import build as build_law
from visco_laws import POLYUREA, TERMS

from warp_pd import (
    Circle,
    CriticalStretch,
    Explicit,
    Fixed,
    MooneyRivlin,
    Motion,
    Newton,
    Nodal,
    Relaxation,
    Sheet,
    Simulation,
    TearingEnergy,
    TensionField,
    Visco,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.materials import energy_density
from warp_pd.run.recorder import FramePoints

MATERIAL, MEMBRANE = MooneyRivlin(2e5, 1e4), LAWS["membrane"]
F = rotation()[:, :2] @ np.diag([1.4, 1.1])
EXACT = float(energy_density(MATERIAL, 1.4, 1.1))
SHEETS = {
    "lattice": lambda: square(11),
    "cloud": lambda: jittered(11),
    "cut": lambda: square(13).cut((0.02, 0.052), (0.07, 0.061)),
    "grid": lambda: holed(25),
    "stiffened": lambda: square(11).stiffened(range(40), 4.0),
    "tapered": lambda: square(11, thickness=np.linspace(1e-3, 3e-3, 121)),
}


def shown(built, displacement):
    """The field of a frame at a displacement."""
    built.state.displacement.assign(displacement.astype(built.state.displacement.numpy().dtype))
    built.context.run("frame")
    return FramePoints(built).frame(0, 0.0).point_data["strain_energy_density"]


@pytest.mark.parametrize("weights", ["plain", "corrected"])
@pytest.mark.parametrize("horizon", [2.015, 3.15])
@pytest.mark.parametrize("sheet", SHEETS)
def test_density_is_exact_in_uniform_states(sheet, horizon, weights):
    sheet = SHEETS[sheet]()
    built = build(sheet, horizon=horizon, weights=weights, material=MATERIAL)
    exact = EXACT if sheet.stiffness is None else EXACT * sheet.stiffness
    assert shown(built, uniform(sheet, F)) == pytest.approx(exact, rel=1e-10)


def test_density_is_exact_with_published_weights_and_in_float32():
    sheet = square(11)
    published = build(sheet, weights="published", material=MATERIAL)
    assert shown(published, uniform(sheet, F)) == pytest.approx(EXACT, rel=1e-10)
    single = build(sheet, weights="corrected", material=MATERIAL, precision=32)
    assert shown(single, uniform(sheet, F)) == pytest.approx(EXACT, rel=1e-5)


@pytest.mark.parametrize("weights", ["plain", "corrected"])
@pytest.mark.parametrize("sheet", ["lattice", "cloud", "stiffened", "tapered"])
def test_density_is_exact_beside_a_tear(sheet, weights):
    sheet = SHEETS[sheet]()
    built = build(sheet, horizon=3.15, weights=weights, material=MATERIAL, damage=CriticalStretch(9.0))
    assert sever(built, ((0.02, 0.048), (0.07, 0.062))).any()
    bits = built.law.intact.numpy()
    bits[:, 5] = 0
    built.law.intact.assign(bits)
    found = shown(built, uniform(sheet, F))
    exact = EXACT if sheet.stiffness is None else EXACT * sheet.stiffness
    known = found > 0.0
    assert found[5] == 0.0 and known.mean() > 0.95
    assert found[known] == pytest.approx(np.broadcast_to(exact, sheet.size)[known], rel=1e-10)


def test_damage_reduces_the_density_of_its_point():
    sheet = square(13)
    built = build(sheet, weights="corrected", material=MATERIAL, damage=TearingEnergy(1e9))
    damage = soften(built)
    assert shown(built, uniform(sheet, F)) == pytest.approx(EXACT * (1.0 - damage) ** 2, rel=1e-10)


def test_density_is_exact_on_an_inflated_sphere():
    sheet = small_sphere(8)
    exact = float(energy_density(MATERIAL, 1.5, 1.5))
    assert shown(build(sheet, material=MATERIAL), 0.5 * sheet.points) == pytest.approx(exact, rel=1e-9)


@pytest.mark.parametrize("torn", [False, True])
def test_density_of_other_laws_is_exact(torn):
    sheet, damage = jittered(13), {"damage": CriticalStretch(9.0)} if torn else {}
    equibiaxial = uniform(sheet, rotation()[:, :2] * 1.2)
    for built, displacement, exact in (
        (build_law(sheet, Nodal(MATERIAL), **damage), uniform(sheet, F), EXACT),
        # Of the isotropic strain s: E s^2 / (1 - nu).
        (pairwise(sheet, **damage), equibiaxial, 1.5 * YOUNG * 0.2**2),
    ):
        if torn:
            sever(built, ((0.02, 0.048), (0.07, 0.062)))
        found = shown(built, displacement)
        assert found == pytest.approx(exact, rel=1e-10)


PAIRWISE = {
    **{name: SHEETS[name] for name in ("lattice", "cut", "stiffened", "tapered")},
    "cells": lambda: square(13, centred=True),
    "cloud": lambda: jittered(13),
    "disc": lambda: Sheet.outline(Circle((0.0, 0.0), 0.05), spacing=0.009, thickness=1e-3, density=1000.0),
}


@pytest.mark.parametrize("horizon", [1.5, 2.015, 3.0])
@pytest.mark.parametrize("sheet", PAIRWISE)
def test_fields_of_pairwise_laws_are_uniform_in_uniform_states(sheet, horizon):
    """At edges, corners and cuts they are those of the families inside, taut and compressed bonds alike."""
    sheet = PAIRWISE[sheet]()
    state, middle = uniform(sheet, [[1.05, 0.02], [0.01, 0.97], [0.0, 0.0]]), sheet.nearest(*sheet.points.mean(axis=0))
    built = pairwise(sheet, MEMBRANE, horizon=horizon, fields=("principal_stress",))
    density, factor = shown(built, state), np.ones(sheet.size) if sheet.stiffness is None else sheet.stiffness
    assert density / factor == pytest.approx(density[middle] / factor[middle], rel=1e-10)
    largest, smallest, angle = array(built, "principal_stress").numpy().T
    stresses = np.column_stack([largest, smallest]) / factor[:, None]
    assert stresses == pytest.approx(np.broadcast_to(stresses[middle], stresses.shape), rel=1e-9)
    assert angle == pytest.approx(angle[middle], abs=1e-9)
    if sheet.lattice is not None and not sheet.cuts:
        # Inside it is the energy of the bonds over the volume.
        energy = built.law.strain_energy.numpy()[middle] / (sheet.areas * sheet.thickness * np.ones(sheet.size))[middle]
        assert density[middle] == pytest.approx(energy, rel=1e-10)


@pytest.mark.parametrize("torn", [False, True])
def test_density_of_the_published_viscous_law_is_that_of_yeoh(torn):
    sheet = jittered(11)
    law = ViscoBondBased(Yeoh(1e4, 2e3))
    built = build_law(sheet, law, **({"damage": CriticalStretch(9.0)} if torn else {}))
    if torn:
        sever(built, ((0.02, 0.048), (0.07, 0.062)))
    excess = (F**2).sum() - 2.0
    assert shown(built, uniform(sheet, F)) == pytest.approx(1e4 * excess + 2e3 * excess**2, rel=1e-10)


def test_density_of_a_viscous_sheet_is_that_of_the_jump():
    sheet = square(9)
    start = uniform(sheet, F)
    built = Simulation(
        sheet, Visco(POLYUREA, horizon=3.15, weights="plain", prony=TERMS), Explicit(1.0), initial_displacement=start
    ).build("cpu", 64)
    built.context.run("start")
    found = shown(built, start)
    assert found == pytest.approx(found[40], rel=1e-9) and found[40] > 0.0


@pytest.mark.parametrize("solver", [Newton(load_steps=1), Relaxation(load_steps=1), Explicit(1e-3, frames=1)])
def test_density_of_a_prestretched_sheet_is_that_of_its_stretch(solver):
    sheet = square(9).prestretched(1.3, 1.1)
    frame = (
        Simulation(
            sheet, build(square(9), material=MATERIAL).simulation.force, solver, loads=[Fixed(range(sheet.size))]
        )
        .run(device="cpu")
        .frame
    )
    exact = float(energy_density(MATERIAL, 1.3, 1.1))
    assert frame.point_data["strain_energy_density"] == pytest.approx(exact, rel=1e-6)


def test_density_in_equilibrium_is_that_of_uniaxial_tension_up_to_the_edges():
    sheet = square(11)
    frame = Simulation(
        sheet,
        build(sheet, material=TensionField(MATERIAL), weights="corrected").simulation.force,
        Newton(load_steps=2),
        loads=[
            Fixed(range(sheet.size), "z"),
            Fixed(sheet.edges("left"), "x"),
            Fixed(sheet.edges("bottom"), "y"),
            Motion(sheet.edges("right"), times=[0.0, 1.0], x=[0.0, 0.05]),
        ],
    ).run(device="cpu").frame  # fmt: skip
    exact = float(energy_density(MATERIAL, 1.5, 1.5**-0.5))
    assert frame.point_data["strain_energy_density"] == pytest.approx(exact, rel=1e-3)
