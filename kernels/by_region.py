"""Materials by region: combines the Warp functions of several materials into one set.

One vector has the constants of all materials, one material after the other. Its last number is the index of the
material; `of_bond` of the families (kernels/families.py) sets it for each bond.
"""

import functools
from collections.abc import Callable
from typing import Any

import warp as wp

from .factories import constants_of
from .incompressible import named
from .materials import MaterialFunctions
from .numeric import numeric

# (bits, type of all constants, function of a material, its own constants, index of the material, function of those
# after it) -> function.
Declare = Callable[[int, Any, wp.Function, wp.Function, int, wp.Function], wp.Function]


@functools.cache
def by_region(materials: tuple[MaterialFunctions, ...]) -> MaterialFunctions:
    """Functions that select the material by its index; a function that one material lacks is missing."""

    def joined(bits: int, functions: tuple[wp.Function, ...], declare: Declare) -> wp.Function:
        types = [constants_of(material.functions(bits)[0]) for material in materials]
        ends = [sum(each._length_ for each in types[:n]) for n in range(len(types) + 1)]
        Constants = numeric(bits).constants(ends[-1] + 1)
        found = None
        for n, function in reversed(list(enumerate(functions))):
            own = own_constants(Constants, types[n], ends[n], n)
            found = declare(bits, Constants, function, own, n, found)
        return found

    def functions(bits: int) -> tuple[wp.Function, wp.Function]:
        stress, energy = zip(*(material.functions(bits) for material in materials), strict=True)
        return joined(bits, stress, of_strain), joined(bits, energy, of_strain)

    def of(name: str, declare: Declare) -> Callable[[int], wp.Function] | None:
        factories = [getattr(material, name) for material in materials]
        if None in factories:
            return None
        return called(lambda bits: joined(bits, tuple(factory(bits) for factory in factories), declare), name)

    def called(factory: Callable[[int], Any], what: str) -> Callable[[int], Any]:
        names = "_".join(f"{one.functions.__module__}_{one.functions.__name__}" for one in materials)
        return named(factory, materials[0].functions, f"{what}_by_region_{names}")

    return MaterialFunctions(
        functions=called(functions, "functions"),
        near=of("near", with_guess),
        response=of("response", of_strain),
        volume=of("volume", of_strain),
    )


def own_constants(Constants: Any, Own: Any, begin: int, index: int) -> wp.Function:
    """Function (constants of all materials) -> constants of one material, which start at `begin`."""
    count = Own._length_

    @wp.func(name=f"constants_{index}")
    def own(constants: Constants):
        found = Own()
        for k in range(wp.static(count)):
            found[k] = constants[begin + k]
        return found

    return own


def of_strain(bits: int, Constants: Any, function: wp.Function, own: wp.Function, n: int, others: wp.Function) -> Any:
    """(G, constants) -> the values of `function`."""
    real, mat22, last = numeric(bits).real, numeric(bits).mat22, Constants._length_ - 1

    @wp.func(name=f"{function.func.__name__}_{n}")
    def values(G: mat22, constants: Constants):
        if wp.static(others is not None):
            if constants[last] != real(n):
                return others(G, constants)
        return function(G, own(constants))

    return values


def with_guess(bits: int, Constants: Any, function: wp.Function, own: wp.Function, n: int, others: wp.Function) -> Any:
    """(G, constants, guess) -> stress and the next guess."""
    real, mat22, last = numeric(bits).real, numeric(bits).mat22, Constants._length_ - 1

    @wp.func(name=f"{function.func.__name__}_{n}")
    def values(G: mat22, constants: Constants, guess: real):
        if wp.static(others is not None):
            if constants[last] != real(n):
                return others(G, constants, guess)
        return function(G, own(constants), guess)

    return values
