"""CriticalEnergy: the bonds that it counts, and the laws and solvers that it does not go with."""

from helpers import refused, square
from visco_laws import POLYUREA

from warp_pd import BondAssociated, CriticalEnergy, Explicit, Relaxation, Simulation, ViscoBondBased
from warp_pd.papers.critical_energy import crossing_bonds


def test_bonds_across_a_line():
    assert crossing_bonds(3.015) == 36
    assert crossing_bonds(1.1) == 2


def require_refused(said, law, solver):
    with refused(match=said):
        Simulation(square(7), law, solver, damage=CriticalEnergy(1.0)).build("cpu")


def test_parts_that_do_not_fit_critical_energy_are_refused():
    require_refused("^damage = CriticalEnergy .*expected .*fast = False", BondAssociated(POLYUREA), Explicit(1.0))
    law = ViscoBondBased(POLYUREA, horizon=2.015)
    require_refused("^damage = CriticalEnergy: .*Relaxation.*Explicit", law, Relaxation())
    with refused("CriticalEnergy.energy = 0.0: expected a positive number"):
        CriticalEnergy(0.0)
