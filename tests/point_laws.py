"""Nodal, neural and closed-form laws: simulations of them, and small networks."""

import itertools

import numpy as np
from helpers import GENT, NEO, built_on, sever

from warp_pd import CriticalStretch, Explicit, Neural, Nodal, Simulation
from warp_pd.papers.neural.networks import Network

RANGE = (0.8, 4.0)


def build(sheet, law, precision=64, device="cpu", solver=None, **parts):
    return built_on(Simulation(sheet, force=law, solver=solver or Explicit(1.0), **parts), device, precision)


def tiny(seed=0, hidden=(5, 7), **changes):
    """A network with random weights, without force on an undeformed bond."""
    from network_training import at_rest

    rng = np.random.default_rng(seed)
    sizes = [4, *hidden, 2]
    values = {
        "weights": tuple(rng.normal(size=(b, a)) / a for a, b in itertools.pairwise(sizes)),
        "biases": tuple(0.3 * rng.normal(size=b) for b in sizes[1:]),
        "input_mean": np.array([0.1, 0.02, 0.3, 0.0]),
        "input_scale": np.array([0.5, 0.2, 1.1, 1.0]),
        "output_scale": np.array([1.5, 0.7]),
        "material": "NeoHookean",
        "ratios": {"bulk/mu": 100.0},
        "stretches": RANGE,
    }
    return at_rest(Network(**(values | changes)))


def exact_module():
    """The closed form of the neo-Hookean law as a user's own module, from the formula of the paper's quantities."""
    import torch

    class Exact(torch.nn.Module):
        def forward(self, features):
            stretch, angle, c33, det = features.unbind(1)
            a, b = stretch * angle.cos(), stretch * angle.sin()
            g = (c33 * det**2) ** (-1.0 / 3.0)
            along, across = g * (a - c33 * (1.0 + b * b / det) / a), g * b * (1.0 + c33 / det)
            return torch.stack(
                [along * angle.cos() + across * angle.sin(), across * angle.cos() - along * angle.sin()], 1
            )

    return Exact()


LAWS = {
    "nodal": lambda: Nodal(NEO),
    "closed form": lambda: Neural(NEO, evaluation="closed_form"),
    "closed form, Gent": lambda: Neural(GENT, evaluation="closed_form"),
    "neural": lambda: Neural(NEO),
    "neural, tiny": lambda: Neural(NEO, network=tiny()),
    "neural, fused": lambda: Neural(NEO, evaluation="fused", network=tiny()),
}


def damaged(sheet, law):
    """A sheet with a cut, two damaged families, and point 44 without any bond."""
    built = build(sheet, law, damage=CriticalStretch(9.0))
    sever(built, ((0.02, 0.048), (0.07, 0.062)))
    intact, families = built.law.intact.numpy(), built.law.families
    rng = np.random.default_rng(2)
    exists = families.rows_of_points(families.exists)
    for i in (30, 31, 44):
        for k in np.flatnonzero(((rng.random(exists.shape[1]) < 0.8) | (i == 44)) & exists[i]):
            j, reverse = families.heads(i, k), families.reverse_members(i, k)
            intact[k // 32, i] &= ~np.uint32(1 << (k % 32))
            intact[reverse // 32, j] &= ~np.uint32(1 << (reverse % 32))
    built.law.intact.assign(intact)
    return built
