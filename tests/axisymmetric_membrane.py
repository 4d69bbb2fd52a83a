"""Axisymmetric membranes of incompressible Mooney-Rivlin rubber, by methods apart from the package.

W = c10 (I1 - 3) + c01 (I2 - 3) of the stretches a along a meridian and b around the axis, per unstretched volume.
"""

import numpy as np


def energy_slopes(a, b, c10, c01):
    """dW/da and dW/db [Pa]."""
    return (
        2.0 * c10 * (a - 1.0 / (a**3 * b**2)) + 2.0 * c01 * (a * b**2 - 1.0 / a**3),
        2.0 * c10 * (b - 1.0 / (b**3 * a**2)) + 2.0 * c01 * (b * a**2 - 1.0 / b**3),
    )


def vibrating_disc(height, stretch, c10, duration, *, c01=0.0, radius=0.1, density=1e3, elements=400):
    """Height of the centre of a disc, stretched and clamped, that is let go from z = height(r), at every step.

    Linear elements with one point, lumped masses, central differences.

    Returns:
        Times [s] and heights [m].
    """
    edges = np.linspace(0.0, radius / stretch, elements + 1)
    length, middle = np.diff(edges), 0.5 * (edges[1:] + edges[:-1])
    share = 2.0 * np.pi * middle * length
    mass = np.zeros(elements + 1)
    mass[:-1] += 0.5 * share * density
    mass[1:] += 0.5 * share * density
    r, z = stretch * edges, height(stretch * edges)
    velocity = np.zeros((2, elements + 1))
    speed = np.sqrt(12.0 * stretch**4 * (c10 + c01 * stretch**2) / density)
    step = 0.2 * length[0] / speed
    times, centre = [0.0], [z[0]]
    for index in range(int(duration / step)):
        dr, dz = np.diff(r), np.diff(z)
        a = np.hypot(dr, dz) / length
        along, around = energy_slopes(a, 0.5 * (r[1:] + r[:-1]) / middle, c10, c01)
        force = np.zeros((2, elements + 1))
        for axis, change in enumerate((dr, dz)):
            pull = share * along * change / (a * length**2)
            force[axis, :-1] += pull
            force[axis, 1:] -= pull
        hoop = 0.5 * share * around / middle
        force[0, :-1] -= hoop
        force[0, 1:] -= hoop
        velocity += (0.5 if index == 0 else 1.0) * step * force / mass
        velocity[:, -1] = velocity[0, 0] = 0.0
        r, z = r + step * velocity[0], z + step * velocity[1]
        times.append(times[-1] + step)
        centre.append(z[0])
    return np.array(times), np.array(centre)


def first_zero(times, values):
    """Time at which values first fall through zero."""
    k = int(np.flatnonzero(values < 0.0)[0])
    return float(times[k - 1] + (times[k] - times[k - 1]) * values[k - 1] / (values[k - 1] - values[k]))
