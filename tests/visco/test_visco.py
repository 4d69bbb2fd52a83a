"""Visco-hyperelastic laws: their arguments, what they refuse, the state that they keep, why a run diverged."""

import numpy as np
import pytest
import warp as wp
from helpers import refused, square
from visco_laws import LAWS, POLYUREA, TERMS

from warp_pd import (
    CriticalEnergy,
    Explicit,
    Fixed,
    Maxwell,
    Newton,
    Prony,
    Relaxation,
    Simulation,
    TensionField,
    Visco,
    ViscoBondBased,
    Yeoh,
)
from warp_pd.kernels.visco.visco import relaxation_factors


def names_of(law, damage=None):
    """Names of the arrays of a simulation, and of what it does in a step."""
    built = Simulation(square(7), law, Explicit(1.0), damage=damage).build("cpu")
    launches = {name for launch in built.context.stages["step"] for name in launch.parts}
    return {field.name for field in built.context.fields}, launches


def test_without_prony_terms_there_is_no_state():
    fields, launches = names_of(LAWS["stress-free"], CriticalEnergy(1.0))
    assert {"viscous_state", "viscous_work", "prony", "energy_release"} <= fields
    assert {"family_rows_viscous", "add_release"} <= launches
    fields, launches = names_of(LAWS["published"])
    assert {"strain", "viscous_stretch", "prony"} <= fields and "update" in launches
    for law in (Visco(POLYUREA, horizon=2.015), ViscoBondBased(POLYUREA, horizon=2.015)):
        fields, launches = names_of(law)
        assert not fields & {"strain", "viscous_state", "viscous_work", "viscous_stretch", "prony", "energy_release"}
        assert not launches & {"update", "add_release", "family_rows_viscous"}


def test_forces_of_bonds_for_the_energy_release_are_those_of_the_step():
    """All of them are stored, so that each bond has its work; also those of the law without Prony terms."""
    for law in (LAWS["stress-free"], Visco(POLYUREA, horizon=2.015)):
        built = Simulation(square(7), law, Explicit(1.0), damage=CriticalEnergy(1.0)).build("cpu")
        assert built.law.bond_force() is built.law.pairs


def test_both_laws_take_their_arguments_in_one_order():
    for law in (Visco(POLYUREA, 2.015, prony=TERMS), ViscoBondBased(POLYUREA, 2.015, prony=TERMS)):
        assert (law.horizon, law.prony) == (2.015, TERMS)
    for law in (Visco, ViscoBondBased):
        with pytest.raises(TypeError):
            law(POLYUREA, 2.015, "plain", "linear", TERMS)


@pytest.mark.parametrize(("name", "law"), [("Visco", LAWS["stress-free"]), ("ViscoBondBased", LAWS["published"])])
@pytest.mark.parametrize("solver", [Relaxation(), Newton()], ids=["relaxation", "newton"])
def test_static_solvers_refuse_prony_terms(solver, name, law):
    """In one line that names the law and a solver to take."""
    sheet = square(7)
    why = "which have a tangent" if isinstance(solver, Newton) else "Relaxation"
    said = rf"^force = {name}: (?=[^\n]*{why})[^\n]*expected[^\n]*Explicit[^\n]*$"
    with refused(match=said):
        Simulation(sheet, law, solver, loads=[Fixed(sheet.edges("all"))]).build("cpu")


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: Visco(POLYUREA, prony=[TERMS]), "^prony = "),
        (lambda: Visco(TensionField(POLYUREA), prony=TERMS), r"^prony = .*: expected \(\) with a TensionField"),
        (
            lambda: Visco(POLYUREA, branches=Maxwell(1.0, 1.0)),
            r"^branches = .*: expected a sequence of Maxwell",
        ),
        (
            lambda: Visco(POLYUREA, prony=TERMS, branches=(Maxwell(1.0, 1.0),)),
            r"^prony = .*: expected \(\) with branches",
        ),
        (lambda: Maxwell(1.0, 0.0), r"^Maxwell\.time = 0\.0: expected a positive number"),
        (lambda: Visco(POLYUREA, weights="published"), "^weights = 'published': expected 'auto', 'plain' or"),
        (lambda: Visco(POLYUREA, TERMS), r"^horizon = \(Prony\(.*: expected a number"),
        (lambda: ViscoBondBased(POLYUREA, TERMS), r"^horizon = \(Prony\(.*: expected a number"),
        (lambda: ViscoBondBased(Yeoh(1.0, 1.0, 1.0)), "^material = .*: expected Yeoh with c30 = 0"),
    ],
)
def test_wrong_arguments_are_refused(make, said):
    with refused(match=said):
        make()


def test_branches_may_be_a_list():
    assert Visco(POLYUREA, branches=[Maxwell(1.0, 1.0)]) == Visco(POLYUREA, branches=(Maxwell(1.0, 1.0),))


def test_what_a_step_retains_is_right_near_no_step():
    """(1 - exp(-x)) / x, as a series or not."""
    x, out = np.geomspace(1e-9, 3.0, 400), wp.zeros(400, dtype=wp.float64, device="cpu")
    retained = relaxation_factors(64)

    @wp.kernel(module="unique")
    def evaluate(x: wp.array(dtype=wp.float64), out: wp.array(dtype=wp.float64)):
        i = wp.tid()
        out[i] = retained(x[i])

    wp.launch(evaluate, dim=400, inputs=[wp.array(x, dtype=wp.float64, device="cpu")], outputs=[out], device="cpu")
    np.testing.assert_allclose(out.numpy(), -np.expm1(-x) / x, rtol=1e-10)


def test_a_fixed_rate_gives_the_relaxation_time_of_that_rate():
    """Four times the rate halves the time with an exponent of a half."""
    assert Prony(1e5, time=2.0, exponent=0.5, rate=4.0).constants == (1e5, 0.0, 1.0, 0.0)
