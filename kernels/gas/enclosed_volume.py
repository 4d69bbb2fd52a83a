"""An enclosed volume: its size and its pressure, whose force is in kernels/surface_pressure.py.

    V = 1/6 sum over triangles x_a . (x_b x x_c)

with the corners of triangles counter-clockwise seen from outside (the divergence theorem, exact for the triangulated
surface). If rectangles are cut along both diagonals, V is the mean of both triangulations: `coefficient` is then 1/12.
Volumes are summed in float64, in blocks of triangles in a fixed order, so they repeat bit for bit.
"""

import functools

import warp as wp

from ..effects import Kernel, kernel
from ..numeric import numeric

# Triangles that one thread sums.
BLOCK = 64

# A law of pressure is a Warp function (volume [m^3], factor, constants) -> p and dp/dV, all in float64.


@wp.func
def difference(one: wp.float64, other: wp.float64):
    """Return one - other, without what is round-off of a sum: it would be the only load of a gas at rest."""
    apart = one - other
    if wp.abs(apart) < wp.float64(1.0e-13) * wp.abs(other):
        apart = wp.float64(0.0)
    return apart


@wp.func
def polytropic_gas(volume: wp.float64, amount: wp.float64, constants: wp.vec4d):
    """Gas with (p + ambient) / density^n constant; constants: absolute pressure, volume, ambient pressure, n.

    The remains of a torn surface may be inside out; the pressure is then zero.
    """
    result = wp.vec2d(wp.float64(0.0), wp.float64(0.0))
    if volume > wp.float64(0.0):
        absolute = constants[0] * wp.pow(amount * constants[1] / volume, constants[3])
        result = wp.vec2d(difference(absolute, constants[2]), -constants[3] * absolute / volume)
    return result


@wp.func
def prescribed_volume(volume: wp.float64, target: wp.float64, constants: wp.vec4d):
    """Pressure proportional to the difference from the prescribed volume; constants: stiffness [Pa/m^3]."""
    return wp.vec2d(constants[0] * difference(target, volume), -constants[0])


@functools.cache
def enclosed_volume(bits: int, rate: bool) -> Kernel:
    """Kernel `sum_triangles`.

    It fills row 0 of `sums` [2, blocks] with six times the volume of blocks of triangles and, with `rate`, row 1 with
    six times its derivative along a direction; groups of blocks are added by kernels/block_sums.py.
    """
    vec3 = numeric(bits).vec3
    block = BLOCK

    @kernel(per="block")
    def sum_triangles(
        triangles: wp.array(dtype=wp.vec3i),
        positions: wp.array(dtype=wp.vec3d),
        displacement: wp.array(dtype=vec3),
        direction: wp.array(dtype=vec3),
        first: int,
        sums: wp.array2d(dtype=wp.float64),
    ):
        block_index = wp.tid() + first
        volume = wp.float64(0.0)
        change = wp.float64(0.0)
        for t in range(block_index * block, wp.min((block_index + 1) * block, triangles.shape[0])):
            a, b, c = triangles[t][0], triangles[t][1], triangles[t][2]
            xa = positions[a] + wp.vec3d(displacement[a])
            xb = positions[b] + wp.vec3d(displacement[b])
            xc = positions[c] + wp.vec3d(displacement[c])
            volume += wp.dot(xa, wp.cross(xb, xc))
            if wp.static(rate):
                moved = wp.vec3d(direction[a]) + wp.vec3d(direction[b]) + wp.vec3d(direction[c])
                change += wp.dot(moved, wp.cross(xb - xa, xc - xa))
        sums[0, block_index] = volume
        sums[1, block_index] = change

    return sum_triangles


@functools.cache
def gas_leak(bits: int, scheduled: bool) -> tuple[Kernel, Kernel]:
    """Kernels `sum_open` and `lose_gas`, for gas that escapes through cracks.

    sum_open fills row 0 of `sums` [2, blocks] with the deformed area [m^2] of the triangles cut by cracks, which span
    the openings. lose_gas reduces the remaining fraction of the gas, `left` [1], by one step of orifice flow, dm/dt =
    -C A rho sqrt(2 p / rho); the flow stops when the pressures inside and outside are equal.
    """
    types = numeric(bits)
    real, vec3 = types.real, types.vec3
    block = BLOCK

    @kernel(per="block")
    def sum_open(
        triangles: wp.array(dtype=wp.vec3i),
        intact_faces: wp.array(dtype=wp.uint8),
        positions: wp.array(dtype=wp.vec3d),
        displacement: wp.array(dtype=vec3),
        first: int,
        sums: wp.array2d(dtype=wp.float64),
    ):
        block_index = wp.tid() + first
        area = wp.float64(0.0)
        for t in range(block_index * block, wp.min((block_index + 1) * block, triangles.shape[0])):
            if intact_faces[t] == wp.uint8(0):
                a, b, c = triangles[t][0], triangles[t][1], triangles[t][2]
                xa = positions[a] + wp.vec3d(displacement[a])
                side = positions[b] + wp.vec3d(displacement[b]) - xa
                other = positions[c] + wp.vec3d(displacement[c]) - xa
                area += wp.float64(0.5) * wp.length(wp.cross(side, other))
        sums[0, block_index] = area
        sums[1, block_index] = wp.float64(0.0)

    @kernel(per="once")
    def lose_gas(
        sums: wp.array2d(dtype=wp.float64),
        enclosed: wp.array(dtype=wp.float64),
        discharge: wp.float64,
        density: wp.float64,
        constants: wp.vec4d,
        step: wp.array(dtype=real),
        factors: wp.array(dtype=vec3),
        schedule: int,
        first: int,
        left: wp.array(dtype=wp.float64),
    ):
        """`discharge`: coefficient times open fraction of each triangle; `density` [kg/m^3]: at ambient pressure."""
        area = wp.float64(0.0)
        for b in range(sums.shape[1]):
            area += sums[0, b]
        pressure = enclosed[0]
        volume = enclosed[1]
        if area > wp.float64(0.0) and volume > wp.float64(0.0):
            inverse = wp.float64(1.0) / constants[3]
            balanced = wp.pow(constants[2] / constants[0], inverse) * volume / constants[1]
            factor = wp.float64(1.0)
            if wp.static(scheduled):
                factor = wp.float64(factors[schedule][0])
            amount = factor * left[0]
            flowing = balanced
            if pressure > wp.float64(0.0):
                flowing = amount
            speed = wp.sqrt(wp.float64(2.0) * wp.abs(pressure) * balanced / (density * flowing))
            change = discharge * area * speed * wp.float64(step[0]) * flowing / volume
            most = wp.abs(amount - balanced)
            if pressure > wp.float64(0.0):
                amount -= wp.min(change, most)
            else:
                amount += wp.min(change, most)
            left[0] = amount / factor

    return sum_open, lose_gas


@functools.cache
def enclosed_pressure(bits: int, law: wp.Function, scheduled: bool, leaks: bool) -> Kernel:
    """Kernel `set_pressure`: fills `enclosed` [3] with pressure [Pa], volume [m^3] and the pressure's derivative.

    With `leaks`, the factor of the law is multiplied by the remaining fraction of the gas, `left` [1].
    """
    vec3 = numeric(bits).vec3

    @kernel(per="once")
    def set_pressure(
        sums: wp.array2d(dtype=wp.float64),
        coefficient: wp.float64,
        chamber: wp.float64,
        constants: wp.vec4d,
        factors: wp.array(dtype=vec3),
        schedule: int,
        left: wp.array(dtype=wp.float64),
        first: int,
        enclosed: wp.array(dtype=wp.float64),
    ):
        volume = wp.float64(0.0)
        change = wp.float64(0.0)
        for b in range(sums.shape[1]):
            volume += sums[0, b]
            change += sums[1, b]
        volume = coefficient * volume + chamber
        factor = wp.float64(1.0)
        if wp.static(scheduled):
            factor = wp.float64(factors[schedule][0])
        if wp.static(leaks):
            factor = factor * left[0]
        found = law(volume, factor, constants)
        enclosed[0] = found[0]
        enclosed[1] = volume
        enclosed[2] = found[1] * coefficient * change

    return set_pressure
