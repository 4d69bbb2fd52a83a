"""Families of bonds in two layouts, read through the same functions.

Lattice: all points share one stencil. Points with the same neighbourhood form a family class (`family_class`) and share
one row of a small table: bits, shape tensors, weights, area. Cloud: every point has its own row.

Lengths are in units of the horizon: xi = X / horizon. Areas are in units of one reference area, the mean
area of a point. Every tabulated number is therefore of order one, in any system of units and in float32.
"""

import functools
from dataclasses import dataclass
from typing import Any

import warp as wp

from .numeric import numeric

WORD = 32


@dataclass(frozen=True)
class FamilyFunctions:
    """Warp functions of one layout; `family` is its struct, i a point, k a member of the family of i.

    Attributes:
        struct: The Warp struct that holds the tables.
        neighbour: (family, i, k) -> index of the point; not a valid index for members that do not exist.
        reverse: (family, i, k) -> member index of the reverse bond, i in the family of that point; likewise.
        bond: (family, i, k) -> xi_ik, vec2.
        influence: (family, i, k) -> w_ik.
        common: (family, i, k, word) -> bits of the members that also lie within the horizon of k.
        initial: (family, i, word) -> bits of the members that exist in the undamaged sheet.
        shape: (family, i, k) -> inverse of K_ik of the undamaged sheet: components 11, 12, 22.
        weight: (family, i, k) -> W_ik divided by the reference area.
        area: (family, i) -> a_i divided by the reference area.
        family_area: (family, i) -> undamaged |H_i| divided by the reference area.
    """

    struct: Any
    neighbour: wp.Function
    reverse: wp.Function
    bond: wp.Function
    influence: wp.Function
    common: wp.Function
    initial: wp.Function
    shape: wp.Function
    weight: wp.Function
    area: wp.Function
    family_area: wp.Function


@functools.cache
def lattice_functions(bits: int, module: str) -> FamilyFunctions:
    """Functions of the lattice layout."""
    types = numeric(bits)
    real, vec2, vec3 = types.real, types.vec2, types.vec3

    @functools.partial(wp.struct, module=module)
    class LatticeFamily:
        members: wp.int32
        words: wp.int32
        stencil_shift: wp.array(dtype=wp.int32)
        stencil_reverse: wp.array(dtype=wp.int32)
        stencil_bond: wp.array(dtype=vec2)
        stencil_influence: wp.array(dtype=real)
        stencil_common: wp.array2d(dtype=wp.uint32)
        family_class: wp.array(dtype=wp.int32)
        class_initial: wp.array2d(dtype=wp.uint32)
        class_shape: wp.array2d(dtype=vec3)
        class_weight: wp.array2d(dtype=real)
        class_area: wp.array(dtype=real)
        class_family_area: wp.array(dtype=real)

    @wp.func(module=module)
    def neighbour(family: LatticeFamily, i: int, k: int):
        return i + family.stencil_shift[k]

    @wp.func(module=module)
    def reverse(family: LatticeFamily, i: int, k: int):
        return family.stencil_reverse[k]

    @wp.func(module=module)
    def bond(family: LatticeFamily, i: int, k: int):
        return family.stencil_bond[k]

    @wp.func(module=module)
    def influence(family: LatticeFamily, i: int, k: int):
        return family.stencil_influence[k]

    @wp.func(module=module)
    def common(family: LatticeFamily, i: int, k: int, word: int):
        return family.stencil_common[k, word]

    @wp.func(module=module)
    def initial(family: LatticeFamily, i: int, word: int):
        return family.class_initial[family.family_class[i], word]

    @wp.func(module=module)
    def shape(family: LatticeFamily, i: int, k: int):
        return family.class_shape[family.family_class[i], k]

    @wp.func(module=module)
    def weight(family: LatticeFamily, i: int, k: int):
        return family.class_weight[family.family_class[i], k]

    @wp.func(module=module)
    def area(family: LatticeFamily, i: int):
        return family.class_area[family.family_class[i]]

    @wp.func(module=module)
    def family_area(family: LatticeFamily, i: int):
        return family.class_family_area[family.family_class[i]]

    return FamilyFunctions(
        LatticeFamily, neighbour, reverse, bond, influence, common, initial, shape, weight, area, family_area
    )


@functools.cache
def cloud_functions(bits: int, module: str) -> FamilyFunctions:
    """Functions of the cloud layout: tables [member, point]."""
    types = numeric(bits)
    real, vec2, vec3 = types.real, types.vec2, types.vec3

    @functools.partial(wp.struct, module=module)
    class CloudFamily:
        members: wp.int32
        words: wp.int32
        neighbours: wp.array2d(dtype=wp.int32)
        reverses: wp.array2d(dtype=wp.int32)
        bonds: wp.array2d(dtype=vec2)
        influences: wp.array2d(dtype=real)
        commons: wp.array3d(dtype=wp.uint32)
        initials: wp.array2d(dtype=wp.uint32)
        shapes: wp.array2d(dtype=vec3)
        weights: wp.array2d(dtype=real)
        areas: wp.array(dtype=real)
        family_areas: wp.array(dtype=real)

    @wp.func(module=module)
    def neighbour(family: CloudFamily, i: int, k: int):
        return family.neighbours[k, i]

    @wp.func(module=module)
    def reverse(family: CloudFamily, i: int, k: int):
        return family.reverses[k, i]

    @wp.func(module=module)
    def bond(family: CloudFamily, i: int, k: int):
        return family.bonds[k, i]

    @wp.func(module=module)
    def influence(family: CloudFamily, i: int, k: int):
        return family.influences[k, i]

    @wp.func(module=module)
    def common(family: CloudFamily, i: int, k: int, word: int):
        return family.commons[k, word, i]

    @wp.func(module=module)
    def initial(family: CloudFamily, i: int, word: int):
        return family.initials[word, i]

    @wp.func(module=module)
    def shape(family: CloudFamily, i: int, k: int):
        return family.shapes[k, i]

    @wp.func(module=module)
    def weight(family: CloudFamily, i: int, k: int):
        return family.weights[k, i]

    @wp.func(module=module)
    def area(family: CloudFamily, i: int):
        return family.areas[i]

    @wp.func(module=module)
    def family_area(family: CloudFamily, i: int):
        return family.family_areas[i]

    return FamilyFunctions(
        CloudFamily, neighbour, reverse, bond, influence, common, initial, shape, weight, area, family_area
    )


@functools.cache
def family_functions(layout: str, bits: int, module: str) -> FamilyFunctions:
    """Functions of `layout`, "lattice" or "cloud"."""
    return lattice_functions(bits, module) if layout == "lattice" else cloud_functions(bits, module)
