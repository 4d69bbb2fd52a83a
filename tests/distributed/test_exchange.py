"""Where halos are exchanged follows from what launches declare, and what several processes cannot run is refused."""

import functools

import pytest
import warp as wp
from helpers import refused
from shared_scenes import MATERIAL, SIZE, composed, scene

from warp_pd import (
    BodyForce,
    BondAssociated,
    BondBased,
    BoundaryForce,
    Explicit,
    Fixed,
    Free,
    Newton,
    Nodal,
    RigidBody,
    SelfContact,
    Sheet,
    Simulation,
    Sphere,
)
from warp_pd.device.launches import Launch
from warp_pd.kernels.effects import kernel


def exchanged(name, stage="step", number=0):
    made = composed(scene(name))
    return [item.name for item in made.context.stages[stage].round(number) if item.name.startswith("exchange")]


def test_a_step_exchanges_what_its_launches_gather_and_nothing_else():
    assert exchanged("loads") == ["exchange displacement"]
    # The energy that breaking releases needs the velocities around a point; broken bonds follow from displacements.
    assert exchanged("torn") == ["exchange displacement, velocity"]
    # Displacements and velocities are needed by different launches of a field: one exchange brings both.
    of_field = ["exchange displacement, velocity", "exchange damage_field, driving, severed_at"]
    assert exchanged("field") == of_field
    # A step that does not look for damage exchanges what its force needs.
    assert exchanged("field", number=1) == ["exchange displacement"]
    # More sweeps than there are layers of ghost points.
    assert exchanged("field hole") == [*of_field, "exchange damage_field, damage_after_sweep"]
    # Bonds that break by their work follow from forces, which the halo does not have.
    assert any("intact_bonds" in name for name in exchanged("energy"))


@pytest.mark.parametrize("few", [0, 10**6])
def test_the_kernels_of_a_gpu_exchange_the_same(gpu_paths, tune, few):
    """On a CPU their launches can be declared, not run."""
    tune(lattice_bonds=few)
    assert exchanged("loads") == ["exchange displacement"]
    assert exchanged("torn") == ["exchange displacement, velocity"]
    assert exchanged("cloud") == ["exchange displacement, velocity"]


def test_one_process_exchanges_nothing():
    made = scene("torn").build(device="cpu")
    assert not [item for stage in made.context.stages.values() for item in stage if item.name.startswith("exchange")]


def test_motion_that_an_exchange_replaces_is_computed_at_own_points_alone():
    context = composed(scene("loads")).context
    launches = [item for item in context.stages["step"].round(0) if isinstance(item, Launch)]
    places = {part: launch.points for launch in launches for part in launch.parts}
    owned = context.partition.owned
    assert places["drift"] == places["kick"] == (owned.start, owned.stop) != places["family_rows_force"]


def test_the_estimate_of_the_stable_step_exchanges_its_direction_once():
    assert exchanged("loads", "estimate") == ["exchange direction"]


def plain(sheet=None, force=None, solver=None, **parts):
    sheet = sheet or Sheet.rectangle(1.0, 1.0, points=33, **SIZE)
    force = force or BondAssociated(MATERIAL, horizon=2.015)
    parts.setdefault("loads", [Fixed(sheet.edges("left")), BodyForce((0.0, 0.0, -1.0))])
    return Simulation(sheet, force, solver or Explicit(1e-2, frames=1), **parts)


REFUSED = [
    (lambda: plain(solver=Newton()), "solver = Newton: .*expected Explicit or Relaxation"),
    (lambda: plain(force=Nodal(MATERIAL)), "force = Nodal: .*expected BondAssociated or Visco"),
    (lambda: plain(force=BondAssociated(MATERIAL, weights="published")), "weights = 'published': "),
    (lambda: plain(contact=SelfContact()), "contact: SelfContact: not supported on several processes"),
    (
        lambda: plain(contact=RigidBody(Sphere(0.2), Free(mass=1.0, position=(0.5, 0.5, 0.3)))),
        "RigidBody 'body': motion = Free: expected BodyPath",
    ),
    (lambda: plain(loads=[BoundaryForce(1.0)]), "loads: BoundaryForce: not supported on several processes"),
    (
        lambda: plain(sheet=Sheet.rectangle(1.0, 1.0, points=33, **SIZE).inclusion((0.5, 0.5), 0.1), loads=[]),
        "RigidInclusions: not supported on several processes",
    ),
]


@pytest.mark.parametrize(("made", "said"), REFUSED, ids=[said[:24] for _, said in REFUSED])
def test_what_several_processes_cannot_run_is_refused_in_a_line(made, said):
    with refused(match=said):
        composed(made())


def test_other_laws_are_refused_before_their_families_are_built():
    from warp_pd import Bimodular

    with refused(match="force = BondBased: "):
        composed(plain(force=BondBased(Bimodular(1e6, 1e6), horizon=2.015)))


@functools.cache
def far():
    @kernel(gathers=("values",))
    def look_far(values: wp.array(dtype=wp.vec3), first: int, out: wp.array(dtype=wp.vec3)):
        out[wp.tid() + first] = values[0]

    return look_far


def test_a_launch_that_looks_too_far_is_refused():
    """Forces of forces of forces: three horizons around a point."""
    made = composed(scene("loads"))
    context, stage = made.context, made.context.stages["step"]
    n, values = context.sheet.size, context.state.displacement
    for k in range(3):
        out = context.array(f"far_{k}", "test", wp.vec3, shape=n)
        stage.launch("test", far(), n, values=values, out=out)
        values = out
    with refused(match=r"^test: look_far uses points up to 3 horizons away"):
        context.communicator.add_exchanges(list(context.stages.values()), context.fields)
