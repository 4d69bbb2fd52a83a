"""CriticalEnergy: the bonds that it counts, and the laws and solvers that it does not go with."""

import re

import pytest
from helpers import square
from visco_laws import POLYUREA

from warp_pd import BondAssociated, CriticalEnergy, Explicit, InputError, Relaxation, Simulation, ViscoBondBased
from warp_pd.parts.rupture import crossing_bonds


def test_bonds_across_a_line():
    assert crossing_bonds(3.015) == 36
    assert crossing_bonds(1.1) == 2


def refused(said, law, solver):
    with pytest.raises(InputError, match=said):
        Simulation(square(7), law, solver, damage=CriticalEnergy(1.0)).build("cpu")


def test_parts_that_do_not_fit_critical_energy_are_refused():
    refused("^damage = CriticalEnergy .*expected .*fast = False", BondAssociated(POLYUREA), Explicit(1.0))
    refused(
        "^damage = CriticalEnergy: .*Relaxation.*Explicit",
        ViscoBondBased(POLYUREA, horizon=2.015),
        Relaxation(),
    )
    with pytest.raises(InputError, match=re.escape("CriticalEnergy.energy = 0.0: expected a positive number")):
        CriticalEnergy(0.0)
