"""Kernels that evaluate a material at many strains (kernels must live in a file)."""

import functools

import numpy as np
import warp as wp

from warp_pd.kernels.numeric import constants_of, numeric
from warp_pd.materials import capabilities, padded_constants


def strain(F):
    """G = C - I of an in-plane deformation gradient, shape (1, 2, 2)."""
    return (F.T @ F - np.eye(2))[None]


@functools.cache
def evaluator(material, bits):
    types = numeric(bits)
    stress, energy = material(bits)
    Constants = constants_of(stress)

    @wp.kernel(module="unique", enable_backward=False)
    def evaluate(
        strain: wp.array(dtype=types.mat22),
        constants: Constants,
        out_stress: wp.array(dtype=types.mat22),
        out_energy: wp.array(dtype=types.real),
    ):
        i = wp.tid()
        out_stress[i] = stress(strain[i], constants)
        out_energy[i] = energy(strain[i], constants)

    return evaluate


def evaluate(material, strain, bits):
    """Second Piola stress (n, 2, 2) and energy (n,) at G = C - I, shape (n, 2, 2)."""
    types = numeric(bits)
    n = len(strain)
    given = wp.array(strain, dtype=types.mat22, device="cpu")
    stress = wp.zeros(n, dtype=types.mat22, device="cpu")
    energy = wp.zeros(n, dtype=types.real, device="cpu")
    known = padded_constants(material)
    constants = types.constants(len(known))(*known)
    wp.launch(evaluator(material.functions, bits), dim=n, inputs=[given, constants, stress, energy], device="cpu")
    return stress.numpy().astype(float), energy.numpy().astype(float)


@functools.cache
def responder(material, bits):
    types = numeric(bits)
    response = material(bits)
    Constants = constants_of(response)

    @wp.kernel(module="unique", enable_backward=False)
    def respond(
        strain: wp.array(dtype=types.mat22),
        constants: Constants,
        out_stress: wp.array(dtype=types.mat22),
        out_moduli: wp.array(dtype=types.vec6),
    ):
        i = wp.tid()
        S, T = response(strain[i], constants)
        out_stress[i] = S
        out_moduli[i] = T

    return respond


def respond(material, strain, bits):
    """Stress (n, 2, 2) and moduli (n, 6) at G = C - I, shape (n, 2, 2)."""
    types = numeric(bits)
    n = len(strain)
    given = wp.array(strain, dtype=types.mat22, device="cpu")
    stress = wp.zeros(n, dtype=types.mat22, device="cpu")
    moduli = wp.zeros(n, dtype=types.vec6, device="cpu")
    known = padded_constants(material)
    constants = types.constants(len(known))(*known)
    kernel = responder(capabilities(material).response, bits)
    wp.launch(kernel, dim=n, inputs=[given, constants, stress, moduli], device="cpu")
    return stress.numpy().astype(float), moduli.numpy().astype(float)
