"""Generalised alpha (Chung and Hulbert 1993)."""

from __future__ import annotations


def coefficients(dt: float, radius: float, inertia: bool, damping: float) -> dict[str, float]:
    """Coefficients of a step, by the names of `COEFFICIENTS` in kernels/implicit/motion.py.

    Args:
        dt: The step [s].
        radius: Spectral radius for the highest frequencies (Chung and Hulbert 1993, eqs. 17, 20, 25).
        inertia: Whether there is inertia. Without it forces are those at the end of a step, and the velocity is a
            difference of second order, which forgets an earlier one in two steps (a radius of 0).
        damping: Mass damping [1/s].
    """
    if not inertia:
        radius = 0.0
    of_mass = (2.0 * radius - 1.0) / (radius + 1.0)
    of_force = radius / (radius + 1.0)
    beta, gamma = 0.25 * (1.0 - of_mass + of_force) ** 2, 0.5 - of_mass + of_force
    A = 1.0 / (beta * dt**2)
    share = float(inertia) / (1.0 - of_force)
    return {
        "dt": dt, "A": A, "B": gamma * dt * A, "from_velocity": -A * dt,
        "from_acceleration": -A * dt**2 * (0.5 - beta), "of_acceleration": dt * (1.0 - gamma), "of_star": dt * gamma,
        "at_end": share * (1.0 - of_mass), "at_begin": share * of_mass, "earlier": of_force / (1.0 - of_force),
        "damping": damping, "error": dt**2 / 12.0,
    }  # fmt: skip
