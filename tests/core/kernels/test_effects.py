"""Declared effects of kernels, compared with what the kernels read and write.

A launch may write the arrays that it declares and no others. A kernel that works on points may write its own point
alone, and may read other points only of what it declares as gathered. To find out, a part of the points is launched
while all other entries hold NaN.
"""

import ast
import importlib.util
import sys
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest
import warp as wp
from curved_sheets import small_tube
from helpers import NEO, play_gpu, square, tune_paths
from own_parts import recipe
from shared_scenes import composed
from shared_scenes import scene as shared

import warp_pd
from warp_pd import (
    Bimodular,
    BondAssociated,
    BondBased,
    Box,
    Capsule,
    CriticalEnergyDensity,
    CriticalStretch,
    CutsInTime,
    EnclosedGas,
    EnclosedVolume,
    Explicit,
    Fixed,
    Free,
    Implicit,
    Joint,
    Mirror,
    Motion,
    Neural,
    Newton,
    Nodal,
    Place,
    Plate,
    PointForce,
    Pressure,
    Prony,
    Punch,
    Reaction,
    Relaxation,
    RigidBall,
    RigidBody,
    SelfContact,
    Simulation,
    Sphere,
    TearingEnergy,
    ValuesInTime,
    Visco,
    Weld,
    Yeoh,
    placed,
    together,
)
from warp_pd.device import launches
from warp_pd.device.launches import Launch, arrays_in
from warp_pd.kernels import block_sums
from warp_pd.tearing import damage_field

ROOT = Path(__file__).parents[3]
SPEC = importlib.util.spec_from_file_location("compare_checkouts", ROOT / "tools" / "compare_checkouts.py")
compare_checkouts = importlib.util.module_from_spec(SPEC)
sys.modules[SPEC.name] = compare_checkouts
SPEC.loader.exec_module(compare_checkouts)

# Kernels whose threads share memory.
SHARING = ("family_block_force",)
CASES = (
    "law published", "law plain, cloud, torn", "law slow", "law nodal", "law nodal, cloud, torn", "law bonds",
    "law hyperelastic", "law closed form", "law fused", "law torch", "law visco", "law visco bonds",
    "law visco bonds, cloud, torn", "material gent", "material ogden", "all loads", "pressure torn", "ball torn",
    "boundary force torn", "inclusion", "critical energy visco", "fields", "relaxed", "relaxed pressure",
    "relaxed cloud", "newton", "newton jacobi", "newton pressure", "newton bonds constant",
)  # fmt: skip


def bodies(friction):
    """Two on a path and two free ones, one of each with a surface."""
    still = RigidBody(Box((1.0, 1.0, 1.0)), warp_pd.BodyPath.still((0.0, 0.0, 9.0)), friction=friction, name="still")
    path = warp_pd.BodyPath.still((9.0, 0.0, 0.0))
    thin = RigidBody(Capsule(0.1, 1.0), path, friction=friction, name="thin", surface=True)
    edged = RigidBody(Capsule(0.1, 1.0), Free(1.0, (0.0, 9.0, 0.0)), friction=friction, name="edged", surface=True)
    free = RigidBody(Sphere(1.0), Free(1.0, (0.0, 0.0, -9.0)), friction=friction, name="free")
    return [still, thin, edged, free]


def further():
    """Cases that the small ones of compare_checkouts leave out, by name."""
    loads = lambda sheet: [Fixed(sheet.edges("left")), Pressure(2.0)]  # noqa: E731
    plane, bonds = square(25), BondBased(Bimodular(3e3, 1e3))
    in_plane = [Fixed(plane.edges("left")), Fixed(plane.where(lambda x, y: x > 0.0), "z")]
    dead = [*in_plane, PointForce(plane.edges("right"), (1e-3, 0.0, 0.0), ramp=((0.0, 0.0), (1.0, 1.0)))]
    law = BondAssociated(NEO, horizon=2.015, weights="plain")
    right = plane.edges("right")
    mirrored = Mirror(right, right - 2, np.ones((25, 2)), np.ones((25, 2), bool))
    clamp, drawn = Fixed(plane.edges("all")), square(25).prestretched(1.2)
    gas = EnclosedGas(gauge=3.0, chamber=1e-3, amount=[(0.0, 1.0), (1.0, 2.0)], leak=0.8)
    volume = EnclosedVolume([(0.0, 1e-5)], stiffness=1e6)
    both, welded = together(square(9), square(7)), (Place(), Place())
    moves = [Motion(drawn.edges("right"), [0.0, 1.0], x=[0.0, 1e-3])]
    shown = ("stretch", "direction", "first_piola", "cauchy", "wrinkle_state", "bonds")
    visco = Visco(Yeoh(1e5, 1e3), horizon=2.015, prony=(Prony(c10=1e5, time=1.0),))
    return {
        "fields of bonds torn": Simulation(
            plane, law, Explicit(1.0), fields=shown, damage=CriticalStretch(2.0), loads=[clamp, Reaction([3, 4, 5])]
        ),
        "means torn": Simulation(plane, law, Explicit(1.0), damage=CriticalEnergyDensity(1e9)),
        "cut in time": Simulation(
            plane, law, Explicit(1.0), damage=CutsInTime(Punch((0.05, 0.05), 0.02, at=0.0), beside=TearingEnergy(1e9))
        ),
        "fields of families": Simulation(plane, Nodal(NEO, 2.015), Explicit(1.0), fields=shown),
        "fields of viscous bonds": Simulation(small_tube(), visco, Explicit(1.0), fields=shown),
        "implicit": Simulation(plane, visco, Implicit(1.0, steps=1, damping=1.0), loads=[clamp, Pressure(1.0)]),
        "visco slow": Simulation(plane, replace(visco, fast=False), Explicit(1.0)),
        "bending": Simulation(plane, law, Newton(preconditioner="direct"), loads=[clamp, Plate()]),
        "bending curved": Simulation(small_tube(), law, Newton(), loads=[Fixed([0]), Plate(1e-4)]),
        "bending torn": Simulation(plane, law, Explicit(1.0), damage=TearingEnergy(1.0), loads=[Plate(1e-4)]),
        "gas torn": Simulation(plane, law, Explicit(1.0), loads=[clamp, gas], damage=CriticalStretch(2.0)),
        "values by point": Simulation(
            small_tube(),
            BondAssociated(recipe("temperature").WarmRubber(1e3, by_point=1.2)),
            Explicit(1.0),
            loads=[Fixed([0]), ValuesInTime([(0.0, 1.0)])],
        ),
        "internal variable": Simulation(
            small_tube(), BondAssociated(recipe("mullins").Mullins(1e3, 1.5, 100.0)), Explicit(1.0), loads=[Fixed([0])]
        ),
        "volume": Simulation(plane, law, Newton(preconditioner="jacobi"), loads=[clamp, volume]),
        "prestretched": Simulation(drawn, law, Explicit(1.0), loads=moves),
        "given inclusion": Simulation(
            plane.rigid([0, 1, 25]), law, Explicit(1.0), loads=[Fixed([0, 1, 25]), Pressure(2.0)]
        ),
        "curved torn": Simulation(
            small_tube(),
            law,
            Explicit(1.0),
            damage=TearingEnergy(30.0, spared=[0]),
            loads=[Fixed([0]), Pressure(2.0)],
            contact=RigidBall(1.0, (0.0, 0.0, 9.0)),
        ),
        "self-contact torn": Simulation(
            plane, law, Explicit(1.0), contact=SelfContact(friction=0.3), damage=CriticalStretch(2.0)
        ),
        "two pieces": Simulation(
            both, law, Explicit(1.0), contact=SelfContact(friction=0.3), loads=[Fixed(both.edges("sheet 1"))]
        ),
        "triangles": Simulation(
            both, law, Explicit(1.0), contact=SelfContact(friction=0.3, surface=True), damage=CriticalStretch(2.0)
        ),
        "joint": Simulation(
            both,
            law,
            Explicit(1.0),
            initial_displacement=placed(both, Place(), Place((5e-3, 5e-3, 1e-3))),
            loads=[Joint(both.edges("sheet 2"), both.edges("sheet 1"), energy=1.0, reach=2e-3)],
        ),
        "weld": Simulation(
            both, law, Explicit(1.0), loads=[Weld([0], [81])], initial_displacement=placed(both, *welded)
        ),
        "bodies": Simulation(plane, law, Explicit(1.0), loads=loads(plane), contact=bodies(0.0)),
        "bodies torn": Simulation(
            plane, law, Explicit(1.0, damping=1.0), damage=TearingEnergy(1.0), contact=bodies(0.3)
        ),
        "curved relaxed": Simulation(small_tube(), law, Relaxation(), loads=[Fixed([0]), Pressure(2.0)]),
        "curved bonds": Simulation(small_tube(), bonds, Explicit(1.0)),
        "damage field": Simulation(plane, law, Explicit(1.0), damage=TearingEnergy(1.0, spared=plane.edges("left"))),
        "damage field of a process": SimpleNamespace(build=lambda _, bits: composed(shared("field", 17), 1, 2, bits)),
        "newton multigrid": Simulation(plane, law, Newton(preconditioner="multigrid"), loads=[*dead, Pressure(2.0)]),
        "relaxed bonds": Simulation(plane, bonds, Relaxation(), loads=in_plane),
        "relaxed pressure and dead loads": Simulation(plane, law, Relaxation(), loads=[*dead, *loads(plane)[1:]]),
        "bonds torn": Simulation(plane, bonds, Explicit(1.0), damage=CriticalStretch(2.0)),
        "newton contact": Simulation(plane, law, Newton(), loads=[clamp], contact=bodies(0.0)[0]),
        "mirror": Simulation(plane, bonds, Relaxation(), loads=[in_plane[1], mirrored]),
        "newton neural": Simulation(
            plane, Neural(NEO, 2.015, evaluation="closed_form"), Newton(preconditioner="jacobi"), loads=[clamp]
        ),
        "newton bonds": Simulation(plane, bonds, Newton(preconditioner="jacobi"), loads=in_plane),
        "pressed triangles": Simulation(
            plane, law, Newton(preconditioner="jacobi"), loads=[clamp, Pressure(1.0, on="triangles")]
        ),
    }


@pytest.fixture(scope="module")
def gpu_paths():
    """Builds simulations with the paths of a large sheet on a GPU, whose blocks a CPU runs one after the other."""
    with pytest.MonkeyPatch.context() as patch:
        play_gpu(patch)
        tune_paths(patch, lattice_bonds=0)
        law = BondAssociated(NEO, horizon=2.015, weights="plain")
        torn = {"damage": CriticalStretch(2.0)}
        cases = ((square(13), {}), (square(13), torn), (square(9).as_cloud(), {}))
        made = [Simulation(sheet, law, Explicit(1.0), **parts) for sheet, parts in cases]
        patch.setattr(damage_field, "finds_at_once", lambda context: True)
        made.append(Simulation(square(9), law, Explicit(1.0), damage=TearingEnergy(1.0)))
        made.append(Simulation(square(9), law, Implicit(1.0, steps=1)))
        return _launches_of([*made, compare_checkouts.parts()["newton jacobi"]()])


@pytest.fixture(scope="module")
def recorded(gpu_paths):
    """Every launch of all cases, each pointwise stage apart, with the simulation it belongs to.

    Of kernels with equal names and arrays, such as those of two materials, the first; only these are compiled.
    """
    # The last case as on a large sheet.
    small = block_sums.MANY_BLOCKS
    made, more = compare_checkouts.parts(), further()
    found = _launches_of(made[name]() for name in CASES) + _launches_of(more.values())
    try:
        block_sums.MANY_BLOCKS = 1
        found += _launches_of([more["bodies"]])
    finally:
        block_sums.MANY_BLOCKS = small
    unique = {}
    for built, launch in [*found, *gpu_paths]:
        unique.setdefault((launch.name, tuple(_names(launch))), (built, launch))
    # Those whose threads share memory are compiled for their own number of threads, as they are launched.
    plain = [launch for _, launch in unique.values() if launch.name not in SHARING]
    launches.compile_launches(plain, wp.get_device("cpu"))
    return list(unique.values())


def _launches_of(simulations):
    """Every launch of some simulations, each pointwise stage apart, with what it belongs to."""
    found = []
    with pytest.MonkeyPatch.context() as patch:
        # Each stage declares its own effects; joined ones declare those of both.
        patch.setattr(launches, "_joined", lambda first, second: None)
        for simulation in simulations:
            built = simulation.build("cpu", 64)
            _prepare(built)
            found += [(built, launch) for stage in built.context.stages.values() for launch in stage.launches()]
    return found


def _prepare(built):
    """A state in which nothing is zero by chance."""
    for name in ("start", "setup"):
        built.context.run(name)
    rng = np.random.default_rng(0)
    for stored in built.context.fields:
        array = stored.array
        if stored.field.per in ("point", "bond") and array.dtype in _REALS and not array.numpy().any():
            array.assign(1e-3 * rng.uniform(0.5, 1.0, array.numpy().shape).astype(array.numpy().dtype))
    if built.state.step is not None:
        built.state.step.assign(np.array([1e-6]))


_REALS = {wp.float32, wp.float64, wp.vec2f, wp.vec2d, wp.vec3f, wp.vec3d, wp.vec4f, wp.vec4d, wp.mat33f, wp.mat33d}


def _names(launch):
    return [name.removeprefix("arguments.") for name, array in _arrays(launch)]


def _arrays(launch):
    return [(name, array) for name, array in arrays_in(launch.arguments) if array.ptr]


def _declared(launch):
    effects = launch.source.effects
    return effects.per, effects.writes, effects.gathers


def _run(launch, begin, end):
    threads, values = launch.slice(begin, end)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(wp.config, "enable_cpu_blocks", launch.name in SHARING)
        wp.launch(launch.kernel, threads, inputs=values, device="cpu", block_dim=launch.block_dim)


def _everything(built, launch):
    """Copies of all arrays of a simulation and of a launch, by address."""
    arrays = {stored.array.ptr: stored.array for stored in built.context.fields}
    arrays.update({array.ptr: array for _, array in _arrays(launch)})
    return {pointer: (array, array.numpy().copy()) for pointer, array in arrays.items()}


def _restore(kept):
    for array, values in kept.values():
        if array.size:
            array.assign(values)


def _same(a, b):
    return a.tobytes() == b.tobytes()


def test_launches_write_what_they_declare(recorded):
    wrong = []
    for built, launch in recorded:
        kept = _everything(built, launch)
        _, writes, _ = _declared(launch)
        allowed = {array.ptr for name, array in _arrays(launch) if name.removeprefix("arguments.") in writes}
        _run(launch, launch.begin, launch.begin + launch.threads)
        changed = {pointer for pointer, (array, values) in kept.items() if not _same(array.numpy(), values)}
        if not changed <= allowed:
            names = [name for name, array in _arrays(launch) if array.ptr in changed - allowed]
            wrong.append(f"{launch.name} writes {names or 'an array that is no argument'}")
        _restore(kept)
    assert not wrong, "\n".join(wrong)


def _point_axis(values, size):
    """The axis of an array that counts points; arrays of vectors come with further axes."""
    if values.ndim and values.shape[0] == size:
        return 0
    return 1 if values.ndim > 1 and values.shape[1] == size else None


def _outside(values, axis, begin, end):
    mask = np.ones(values.shape[axis], bool)
    mask[begin:end] = False
    return (mask,) if axis == 0 else (slice(None), mask)


def _on_points(recorded):
    for built, launch in recorded:
        size = built.context.sheet.size
        if _declared(launch)[0] == "point" and launch.begin == 0 and launch.threads == size:
            yield built, launch, size


def test_kernels_on_points_write_their_own_point(recorded):
    wrong = []
    for built, launch, size in _on_points(recorded):
        kept = _everything(built, launch)
        begin, end = size // 3, size // 2
        _run(launch, begin, end)
        lists = {stored.array.ptr for stored in built.context.fields if stored.field.per == "table"}
        for name, array in _arrays(launch):
            axis = _point_axis(kept[array.ptr][1], size)
            if axis is None or array.ptr in lists:
                continue
            outside = _outside(kept[array.ptr][1], axis, begin, end)
            if not _same(array.numpy()[outside], kept[array.ptr][1][outside]):
                wrong.append(f"{launch.name} writes {name} of another point")
        _restore(kept)
    assert not wrong, "\n".join(wrong)


def _gathered(built, launch, size):
    """Names of the real arrays whose entries at other points change what a launch on some points gives."""
    _, writes, _ = _declared(launch)
    kept = _everything(built, launch)
    begin, end = size // 3, size // 2
    _run(launch, begin, end)
    expected = {array.ptr: array.numpy().copy() for name, array in _arrays(launch) if _plain(name) in writes}
    _restore(kept)
    found = set()
    for name, array in _arrays(launch):
        values = kept[array.ptr][1]
        axis = _point_axis(values, size)
        if axis is None or values.dtype.kind != "f" or _plain(name).split(".")[0] == "family":
            continue
        poisoned = values.copy()
        outside = _outside(values, axis, begin, end)
        poisoned[outside] = np.nan
        array.assign(poisoned)
        _run(launch, begin, end)
        for pointer, before in expected.items():
            after, inside_axis = kept[pointer][0].numpy(), _point_axis(before, size)
            if inside_axis is None:
                continue
            inside = (slice(None),) * inside_axis + (slice(begin, end),)
            if not _same(after[inside], before[inside]):
                found.add(_plain(name))
        _restore(kept)
    return found


def _plain(name):
    return name.removeprefix("arguments.")


def test_kernels_on_points_gather_what_they_declare(recorded):
    wrong = []
    for built, launch, size in _on_points(recorded):
        _, _, gathers = _declared(launch)
        undeclared = _gathered(built, launch, size) - gathers
        if undeclared:
            wrong.append(f"{launch.name} gathers {sorted(undeclared)}, declared are {sorted(gathers)}")
    assert not wrong, "\n".join(wrong)


def _kernels_of_the_package():
    """Names of all functions that the decorators `kernel` and `pointwise` make."""
    for path in sorted((ROOT / "kernels").rglob("*.py")):
        for node in ast.walk(ast.parse(path.read_text())):
            if isinstance(node, ast.FunctionDef):
                for decorator in node.decorator_list:
                    if isinstance(decorator, ast.Call) and getattr(decorator.func, "id", "") in ("kernel", "pointwise"):
                        yield path.name, node.name


def test_every_kernel_is_looked_at(recorded):
    seen = {launch.name for _, launch in recorded}
    # Vectors of Newton's method that only a stage on a GPU works on, and the list of a damage field there.
    on_a_gpu = {"combine", "scale_blocks", "empty"}
    assert {name for _, name in _kernels_of_the_package()} - seen == on_a_gpu
    assert all(isinstance(launch, Launch) for _, launch in recorded)
