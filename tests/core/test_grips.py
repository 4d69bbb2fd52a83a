"""Grips that hold a sheet at its drawn edge: energy of strips in pure shear on every grid, with a damage field."""

import numpy as np
import pytest
from helpers import NEO

from warp_pd import BondAssociated, Fixed, Motion, Newton, Sheet, Simulation, TearingEnergy, TensionField
from warp_pd.materials import energy_density

GRIDS = {"0": {}, "15": {"turn": 15.0}, "45": {"turn": 45.0}, "jittered": {"jitter": 0.3}}
HEIGHT, LENGTH, THICKNESS, STRETCH = 0.04, 0.06, 1e-3, 1.2
MATERIAL = TensionField(NEO)


def gripped(rows, wave=0.0, **grid):
    """An uncut strip at rest: its energy over that of uniform pure shear, and its largest damage.

    Between rollers its edges move apart by a mean times 1 + `wave` cos(pi x / LENGTH): a smooth state. In the
    uniform one the energy density is 0.97 times the strength.
    """
    points = (3 * (rows - 1) // 2 + 1, rows)
    sheet = Sheet.filled(LENGTH, HEIGHT, thickness=THICKNESS, density=1000.0, points=points, **grid)
    top, bottom = sheet.edges("top"), sheet.edges("bottom")
    grips, density = np.concatenate([top, bottom]), float(energy_density(MATERIAL, STRETCH, 1.0))
    loads = [Fixed(np.arange(sheet.size), "z"), Fixed(np.setdiff1d(sheet.edges("left", "right"), grips), "x")]
    columns = np.round(sheet.points[:, 0], 9)
    for sign, grip in ((0.5, top), (-0.5, bottom)):
        for x in np.unique(columns[grip]):
            travel = sign * (STRETCH - 1.0) * HEIGHT * (1.0 + wave * np.cos(np.pi * x / LENGTH))
            loads.append(Motion(grip[columns[grip] == x], [0.0, 1.0], x=0.0, y=[0.0, travel]))
    damage = TearingEnergy(10.0, strength=density / 0.97, spared=grips) if wave == 0.0 else TearingEnergy(1e3)
    scene = Simulation(sheet, BondAssociated(MATERIAL), Newton(load_steps=1), loads=loads, damage=damage)
    last = scene.run(device="cpu", precision=64).history[-1]
    return last["strain"] / (LENGTH * HEIGHT * THICKNESS * density), last["largest_damage"]


@pytest.mark.parametrize("name", ["0", "15", "45", "jittered"])
def test_a_strip_in_uniform_pure_shear_stores_its_exact_energy_and_keeps_quiet_at_its_grips(name):
    """At 0.97 times the strength: a family that is stretched more than the others would be damaged."""
    energy, damage = gripped(14, **GRIDS[name])
    assert energy == pytest.approx(1.0, abs=1e-4)
    assert damage == 0.0


def test_the_energy_of_a_strip_stretched_unevenly_converges_in_second_order():
    coarse, middle, fine = (gripped(rows, wave=0.5, turn=30.0)[0] for rows in (9, 17, 33))
    assert abs(coarse - middle) > 3.0 * abs(middle - fine)
