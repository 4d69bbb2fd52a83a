"""An annulus that wrinkles in bending tends to the tension field as it becomes thinner; larger in docs/bending.md."""

import numpy as np
import pytest
from wrinkled_annulus import INNER, MU, profile, pulled_membrane, shifts, simulation

AROUND, PULL = 48, 0.15


@pytest.fixture(scope="module")
def annuli():
    """Shift of the inner rim [m], and R P_r at 50 mm over that at 30 mm, at 2 mm, 1 mm and in the tension field."""
    found = []
    for thickness, relaxed in ((2e-3, False), (1e-3, False), (1e-3, True)):
        result = simulation(AROUND, thickness, relaxed, (PULL,)).run(device="cpu", precision=32)
        assert result.status == "finished"
        radius, radial, _ = profile(result, AROUND)
        near, far = np.interp([0.03, 0.05], radius, radius * radial)
        found.append((shifts(result)[-1], far / near))
    return np.array(found)


def test_bending_lies_between_the_flat_sheet_and_the_tension_field(annuli):
    """Wrinkles have more energy than the relaxed sheet, and less than the flat one, or they would not form."""
    thick, thin, relaxed = annuli[:, 0]
    flat = INNER - pulled_membrane(PULL * MU, wrinkles=False)(INNER)[0]
    assert flat < thick < thin < relaxed


def test_half_the_thickness_halves_the_distance_to_the_tension_field(annuli):
    """Wrinkles with k^4 = T/(D L^2) have an energy of sqrt(D T)/L per area, which over h is proportional to h.

    Measured here: 0.54 for the displacement, 0.35 for the stress; 0.7 would be the root of the thickness.
    """
    away = annuli[2] - annuli[:2]
    assert (away[1] < 0.7 * away[0]).all()


def test_the_tension_field_has_a_radial_stress_of_one_over_r(annuli):
    """To what the coarse rim leaves, 4 % of its displacement."""
    exact = pulled_membrane(PULL * MU)
    assert exact(0.05)[1] == pytest.approx(exact(0.03)[1], rel=1e-9)
    assert annuli[2, 1] == pytest.approx(1.0, abs=0.04)
    assert annuli[2, 0] == pytest.approx(INNER - exact(INNER)[0], rel=0.05)
