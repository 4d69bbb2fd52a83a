"""What the tests share: small simulations, and their forces and energies at any displacement."""

import contextlib
import re
from dataclasses import replace

import numpy as np
import pytest
import warp as wp

from warp_pd import BondAssociated, Explicit, Gent, InputError, NeoHookean, Sheet, Simulation, context
from warp_pd.device import graph
from warp_pd.families import pack
from warp_pd.fast import force_paths as fast_paths
from warp_pd.geometry.triangulation import crosses
from warp_pd.laws import force_paths
from warp_pd.statics import tangent

MU, BULK = 1e3, 100e3
NEO = NeoHookean(mu=MU, bulk=BULK)
GENT = Gent(mu=MU, bulk=2 * BULK, lock=160.0)


def square(points=13, size=0.1, **changes):
    values = {"thickness": 1e-3, "density": 1000.0, "points": points, **changes}
    return Sheet.rectangle(size, size, **values)


def jittered(points=13, size=0.1, share=0.2, seed=0):
    """A square whose inner points are moved at random by up to `share` spacings."""
    lattice = square(points, size)
    move = np.random.default_rng(seed).uniform(-share, share, (lattice.size, 2)) * lattice.spacing
    move[lattice.edges("left", "right"), 0] = 0.0
    move[lattice.edges("bottom", "top"), 1] = 0.0
    return Sheet.from_points(lattice.points + move, thickness=1e-3, density=1000.0)


def without_triangles(sheet):
    """The points of a flat sheet, which no triangles join."""
    return replace(sheet.as_cloud(), triangles=np.zeros((0, 3), np.int32))


def build(
    sheet, *, horizon=2.015, weights="plain", material=NEO, precision=64, solver=None, law=None, device="cpu", **parts
):
    force = BondAssociated(material, horizon=horizon, weights=weights, **(law or {}))
    return built_on(Simulation(sheet, force=force, solver=solver or Explicit(1.0), **parts), device, precision)


def built_on(simulation, device="cpu", precision=64):
    """A simulation on a device; on a CPU a stage compiles when it first runs, and most tests run one or two."""
    built = simulation.build(device, precision)
    if built.context.device.is_cuda:
        # Graphs capture what is loaded.
        built.context.compile()
    return built


def internal_force(built, displacement):
    """Internal force [N], shape (N, 3)."""
    built.state.displacement.assign(displacement.astype(built.state.displacement.numpy().dtype))
    built.context.run("setup")
    return built.to_numpy(built.state.force)


def largest_square(force, start, built, spacing):
    """Square of the highest frequency of a force, a function of the displacement, at `start` [1/s^2]; by iteration."""
    mass, reach = built.to_numpy(built.state.mass)[:, None], 1e-6 * spacing
    v = np.random.default_rng(0).normal(size=start.shape)
    for _ in range(60):
        v /= np.abs(v).max()
        v = (force(start - reach * v) - force(start + reach * v)) / (2.0 * reach * mass)
    return np.abs(v).max()


def strain_energy(built, displacement):
    """Strain energy [J]."""
    built.state.displacement.assign(displacement.astype(built.state.displacement.numpy().dtype))
    built.context.run("frame")
    return float(built.law.strain_energy.numpy().sum())


def array(built, name):
    return built.context.fields[name]


def sever(built, segment):
    """Break the bonds across a segment, as rupture would."""
    families, points = built.law.families, built.simulation.sheet.points
    tail = np.repeat(points[:, None], families.members, axis=1)
    bonds = families.rows_of_points(families.bonds) if families.bonds.ndim == 3 else families.bonds[None]
    offsets = bonds * families.horizon
    lost = crosses(tail, tail + offsets, segment)
    intact = families.rows_of_points(families.exists) & ~lost
    built.law.intact.assign(np.ascontiguousarray(pack(intact).T))
    return lost


def soften(built, seed=0):
    """Give half of the points a random damage, (N,), by which their families lose stiffness; all bonds stay intact."""
    damage = np.random.default_rng(seed).uniform(-0.4, 0.8, len(built.rupture.field)).clip(0.0)
    built.rupture.field.assign(damage)
    return damage


def uniform(sheet, gradient):
    """Displacement of a uniform deformation gradient, 3x2."""
    identity = np.array([[1.0, 0.0], [0.0, 1.0], [0.0, 0.0]])
    return sheet.points @ (np.asarray(gradient) - identity).T


def rough(sheet, size=0.05, seed=0):
    """A random smooth-and-rough displacement, `size` of it relative to the spacing."""
    rng = np.random.default_rng(seed)
    x = sheet.points / np.ptp(sheet.points)
    smooth = np.column_stack([0.2 * x[:, 0], -0.1 * x[:, 1] + 0.1 * x[:, 0], 0.2 * x[:, 0] * x[:, 1]])
    return np.ptp(sheet.points) * smooth + size * sheet.spacing * rng.normal(size=(sheet.size, 3))


def exact_stress(material, gradient):
    """First Piola stress 3x2 of a uniform gradient, by scipy: an implementation apart from the kernels."""
    from scipy.optimize import brentq

    F = np.asarray(gradient, dtype=float)
    C = F.T @ F
    det, trace = np.linalg.det(C), np.trace(C)

    def shear(c33):
        volume = c33 * det
        modified = volume ** (-1 / 3)
        if isinstance(material, Gent):
            return material.mu * material.lock * modified / (material.lock - modified * (trace + c33) + 3.0)
        return material.mu * modified

    def thickness_stress(c33):
        volume = c33 * det
        if isinstance(material, Gent):
            pressure = 0.5 * material.bulk * (volume - 1.0)
        else:
            pressure = 0.25 * material.bulk * (volume - 1.0 / volume)
        return shear(c33) * (2.0 * c33 - trace) / 3.0 + pressure

    # The root lies on the near side of the pole that the Gent material has at its lock.
    grid = np.geomspace(1e-5, 1e2, 40001) / det
    at = np.flatnonzero((thickness_stress(grid[:-1]) < 0.0) & (thickness_stress(grid[1:]) >= 0.0))
    at = at[(shear(grid[at]) > 0.0) & (shear(grid[at + 1]) > 0.0)]
    assert len(at) == 1
    c33 = brentq(thickness_stress, grid[at[0]], grid[at[0] + 1], xtol=1e-15, rtol=8.9e-16)
    return F @ (shear(c33) * (np.eye(2) - c33 * np.linalg.inv(C)))


def random_gradient(seed):
    """A stretched, sheared and turned sheet, 3x2."""
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    stretch = np.array([[1.3, 0.2], [0.1, 0.9]]) + 0.15 * rng.uniform(-1, 1, (2, 2))
    return rotation[:, :2] @ stretch


@contextlib.contextmanager
def refused(said="", match=""):
    """Context that an input error leaves whose one line contains `said` and matches a regular expression."""
    with pytest.raises(InputError) as caught:
        yield
    line = str(caught.value)
    assert said in line
    assert re.search(match, line), line
    assert "\n" not in line


class Kept:
    """A writer that keeps a value of every frame."""

    def __init__(self, value):
        self.value, self.all = value, []

    def write(self, frame):
        self.all.append(self.value(frame))

    def save(self):
        pass

    close = save


class StopAt:
    """A writer that stops the run at a frame, before its restart file is written."""

    def __init__(self, index):
        self.index = index

    def write(self, frame):
        if frame.index == self.index:
            raise KeyboardInterrupt

    def save(self):
        pass

    def close(self):
        pass


def force_across(built, horizontal):
    """Force per length [N/m] across a lattice line, under a uniform deformation.

    Sums all pairs with one point in row (column) r at or before the line and the other point beyond it.
    """
    lattice, families = built.simulation.sheet.lattice, built.law.families
    bond_force = built.to_numpy(array(built, "bond_force"))
    ox, oy = families.steps[:, 0], families.steps[:, 1]
    across = oy if horizontal else ox
    middle_column, middle_row = lattice.columns // 2, lattice.rows // 2
    total = np.zeros(3)
    for back in range(int(across.max())):
        column = middle_column - (0 if horizontal else back)
        row = middle_row - (back if horizontal else 0)
        i = column + row * lattice.columns
        for k in np.flatnonzero(across > back):
            total += bond_force[k, i] - bond_force[families.reverses[k], i + families.shift[k]]
    return total / (lattice.dx if horizontal else lattice.dy)


def tune_paths(patch, **changes):
    """Change what decides force paths, so that a small sheet takes that of a large one."""
    patch.setattr(fast_paths, "TUNING", replace(fast_paths.TUNING, **changes))


def play_gpu(patch):
    """Let a CPU take the force paths of a GPU, and store no tangent; no public option does, as they are slow there.

    It runs blocks of threads one after the other, and launches whole: their threads share memory. Kernels are compiled
    as they are launched, with that number of threads: what a CPU compiles before has blocks of one thread.
    """
    patch.setattr(graph, "load_kernel", lambda kernel, device: None)
    patch.setattr(context, "compile_launches", lambda launches, device: None)
    patch.setattr(force_paths, "has_shared_memory", lambda device: True)
    patch.setattr(tangent, "stored_on", lambda device: False)
    patch.setattr(graph, "SPLIT_FROM", float("inf"))
    patch.setattr(wp.config, "enable_cpu_blocks", True)
