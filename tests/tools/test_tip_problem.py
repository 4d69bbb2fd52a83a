"""The tip of a tear on a lattice: energies of the strip and of the crack; a tear sets out where it goes on."""

import numpy as np
import pytest
from tip_problem import Strip, grown

from warp_pd.tearing.cut_profiles import _cap


@pytest.mark.parametrize("along", [1.0, 0.5])
def test_a_uniform_strip_stores_what_its_opening_says(along):
    strip = Strip(1.5, 2.0, 10, None, 0.0, 1, along)
    energies = strip.balance()
    inside = strip.y < 4.0
    slope = strip.displacement[1] - strip.displacement[0]
    np.testing.assert_allclose(energies[inside], 0.5 * slope**2, rtol=1e-6)


def test_the_stiffness_along_a_tear_counts_where_the_opening_changes_along_it():
    stiff, soft = (Strip(1.5, 2.0, 10, 18.5, 0.0, 40, along).balance().sum() for along in (1.0, 0.5))
    assert 0.8 * stiff < soft < stiff


def test_a_cut_begins_with_the_energy_of_its_length_and_runs_where_its_tear_goes_on():
    begin, length = 18.5, 2.0
    recess = length * _cap(length, True)
    assert Strip(1.5, length, 10, begin, recess, 30).field() == pytest.approx(
        begin / 100.0 * Strip(1.5, length, 10, 1e3, 0.0, 100).field(), rel=0.03
    )
    rows, with_cap = grown(1.5, length, 10.0, recess, 3), grown(1.5, length, 10.0, 0.0, 1)
    assert rows[0, 1] == pytest.approx(rows[-1, 1], rel=0.03)
    assert with_cap[0, 1] < 0.95 * rows[-1, 1]


@pytest.mark.parametrize("across", [False, True])
def test_a_severed_point_keeps_bonds_only_if_those_across_the_tear_alone_break(across):
    strip, point = Strip(1.5, 2.0, 4, 8.5, 0.0, 20, across=across), 12
    strip.damage[point] = 1.0
    assert strip.breaks()
    crossing = strip.sign[point] < 0.0
    assert not strip.alive[point, crossing].any()
    assert strip.alive[point, ~crossing].any() == across


@pytest.mark.parametrize("pull", [0.0, 0.2])
def test_a_pull_along_the_tear_counts_towards_the_strength(pull):
    below, above = (Strip(1.5, 2.0, 8, None, 0.0, 1, pull=pull) for _ in range(2))
    below.heal_nothing(np.full(8, 0.49 - 0.5 * pull))
    above.heal_nothing(np.full(8, 0.51 - 0.5 * pull))
    assert below.damage.max() == 0.0 < above.damage.max()
