"""Maxwell elements beside an elastic network that a damage field continues beyond its strength."""

import numpy as np
import pytest
from helpers import internal_force, rough, square, strain_energy, uniform

from warp_pd import Explicit, Fixed, Maxwell, MooneyRivlin, Motion, Simulation, TearingEnergy, TensionField, Visco, Yeoh
from warp_pd.materials import energy_density, stretch_of_density

STIFF, TWO = TensionField(Yeoh(500.0, 100.0)), TensionField(MooneyRivlin(400.0, 100.0))
# Instantaneously the branches store three times the energy of a network of 1 kPa.
BRANCHES = (Maxwell(2e3, 0.05), Maxwell(1e3, 0.4))
GC = 10.0


def built_with(branches, material=STIFF, bits=64, points=9, **given):
    """A sheet whose network has Maxwell elements, with a damage field."""
    law = Visco(material, 2.015, branches=branches)
    return Simulation(square(points), law, Explicit(1.0), damage=TearingEnergy(GC, **given)).build("cpu", bits)


def at_strength(built, material=STIFF):
    """Stretch of pure shear at which the elastic network alone has the strength."""
    return stretch_of_density(
        lambda l: energy_density(material, l, 1.0), built.rupture.limit, np.linspace(1.0, 4.0, 800)
    )


def damage_after_steps(built, displacement, steps=30):
    """Damage that a displacement drives when it is held, (N,)."""
    built.state.step.fill_(1e-12)
    for _ in range(steps):
        built.state.velocity.zero_()
        built.state.displacement.assign(displacement)
        built.context.run("step")
    return built.rupture.field.numpy().copy()


@pytest.mark.parametrize(
    ("material", "bits", "step", "rtol"), [(STIFF, 64, 1e-6, 1e-7), (TWO, 64, 1e-6, 1e-7), (TWO, 32, 2e-3, 2e-3)],
    ids=["I1", "I1 and I2", "float32"],
)  # fmt: skip
def test_the_force_is_minus_the_gradient_of_the_energy_across_the_strength(material, bits, step, rtol):
    built = built_with(BRANCHES, material, bits)
    sheet, rng = built.simulation.sheet, np.random.default_rng(2)
    # Chains that were born at other strains.
    built.law.state.assign(rng.uniform(-0.1, 0.1, (*built.law.state.shape, 4)))
    stretch = at_strength(built, material)
    for times in (0.95, 1.0, 1.05, 1.5):
        stretched = uniform(sheet, [[1.0, 0.0], [0.0, times * stretch], [0.0, 0.0]])
        displacement = stretched + 0.2 * rough(sheet)
        force, direction = internal_force(built, displacement), rng.normal(size=displacement.shape)
        step_size = step * sheet.spacing
        ahead, behind = (strain_energy(built, displacement + sign * step_size * direction) for sign in (1.0, -1.0))
        slope = (ahead - behind) / (2.0 * step_size)
        assert slope == pytest.approx(-(force * direction).sum(), rel=rtol)


def test_the_network_that_drives_the_damage_is_the_one_that_is_continued():
    """It goes on from where its own energy is the strength, and what it drives does not depend on the branches."""
    found = []
    for branches in (BRANCHES, (Maxwell(1e-6, 1.0),)):
        built = built_with(branches)
        stretch, sheet = at_strength(built), built.simulation.sheet
        assert built.law.material.material.excess == pytest.approx((stretch - 1.0 / stretch) ** 2, rel=1e-5)
        below = uniform(sheet, [[1.0, 0.0], [0.0, 1.0 + 0.98 * (stretch - 1.0)], [0.0, 0.0]])
        assert damage_after_steps(built, below, 3).max() == 0.0
        stored = strain_energy(built, below) / (built.rupture.limit * sheet.thickness * sheet.areas.sum())
        assert stored > 1.8 if branches == BRANCHES else stored < 1.0
        above = uniform(sheet, [[1.0, 0.0], [0.0, 1.2 * stretch], [0.0, 0.0]])
        above[:, 1] *= np.exp(-(((sheet.points[:, 0] - 0.05) / 0.03) ** 2))
        found.append(damage_after_steps(built, above))
    assert 0.2 < found[0].max() < 0.95
    np.testing.assert_allclose(found[0], found[1], atol=1e-9)


def test_a_strip_that_stiffens_tears_along_one_row_with_its_branches_and_balances():
    """With the law as it is, 52 faces of the same strip tear, half a row more."""
    sheet = square(13).cut((-0.01, 0.0507), (0.03, 0.0507))
    grips = sheet.edges("bottom"), sheet.edges("top")
    result = Simulation(
        sheet,
        Visco(TensionField(Yeoh(5e4, 2e4)), 2.015, branches=(Maxwell(1e5, 1e-3), Maxwell(1e5, 0.02))),
        Explicit(0.03, frames=30, safety=0.2),
        loads=[Fixed(grips[0]), Motion(grips[1], times=[0.0, 0.02, 0.03], x=0.0, y=[0.0, 0.12, 0.12], z=0.0)],
        damage=TearingEnergy(4000.0, spared=np.concatenate(grips)),
    ).run(device="cpu")
    assert result.status == "finished"
    torn, last = (~result.built.rupture.intact_faces.numpy().astype(bool)).sum(), result.history[-1]
    assert 0 < torn <= 36
    assert last["rupture"] > 0.1 * last["external"] and last["viscous"] > 0.1 * last["external"]
    assert max(abs(row["balance_error"]) for row in result.history) < 5e-3
