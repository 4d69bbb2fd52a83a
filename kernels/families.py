"""Families of bonds in two layouts, read through the same functions.

Lattice: all points share one stencil; points with the same surroundings share one row of a small table
(`kind`): its bits, shape tensors, weights and area. Cloud: every point has its own row.

Lengths are in units of the horizon: xi = X / horizon. Areas are in units of one reference area, the mean
area of a point. So every tabulated number is of order one, in any system of units and in float32.
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
        neighbour: (family, i, k) -> index of the point; of members that do not exist a number that is no index.
        mate: (family, i, k) -> the member index under which that point sees i; likewise.
        bond: (family, i, k) -> xi_ik, vec2.
        influence: (family, i, k) -> w_ik.
        common: (family, i, k, word) -> bits of the members that lie within the horizon of k too.
        whole: (family, i, word) -> bits of the members that exist in the undamaged sheet.
        shape: (family, i, k) -> inverse of K_ik of the undamaged sheet: components 11, 12, 22.
        weight: (family, i, k) -> W_ik over the reference area.
        area: (family, i) -> a_i over the reference area.
        family_area: (family, i) -> undamaged |H_i| over the reference area.
    """

    struct: Any
    neighbour: Any
    mate: Any
    bond: Any
    influence: Any
    common: Any
    whole: Any
    shape: Any
    weight: Any
    area: Any
    family_area: Any


@functools.cache
def lattice_functions(bits, module):
    """Functions of the lattice layout."""
    types = numeric(bits)
    real, vec2, vec3 = types.real, types.vec2, types.vec3

    @functools.partial(wp.struct, module=module)
    class LatticeFamily:
        members: wp.int32
        words: wp.int32
        stencil_shift: wp.array(dtype=wp.int32)
        stencil_mate: wp.array(dtype=wp.int32)
        stencil_bond: wp.array(dtype=vec2)
        stencil_influence: wp.array(dtype=real)
        stencil_common: wp.array2d(dtype=wp.uint32)
        kind: wp.array(dtype=wp.int32)
        kind_whole: wp.array2d(dtype=wp.uint32)
        kind_shape: wp.array2d(dtype=vec3)
        kind_weight: wp.array2d(dtype=real)
        kind_area: wp.array(dtype=real)
        kind_family_area: wp.array(dtype=real)

    @wp.func(module=module)
    def neighbour(family: LatticeFamily, i: int, k: int):
        return i + family.stencil_shift[k]

    @wp.func(module=module)
    def mate(family: LatticeFamily, i: int, k: int):
        return family.stencil_mate[k]

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
    def whole(family: LatticeFamily, i: int, word: int):
        return family.kind_whole[family.kind[i], word]

    @wp.func(module=module)
    def shape(family: LatticeFamily, i: int, k: int):
        return family.kind_shape[family.kind[i], k]

    @wp.func(module=module)
    def weight(family: LatticeFamily, i: int, k: int):
        return family.kind_weight[family.kind[i], k]

    @wp.func(module=module)
    def area(family: LatticeFamily, i: int):
        return family.kind_area[family.kind[i]]

    @wp.func(module=module)
    def family_area(family: LatticeFamily, i: int):
        return family.kind_family_area[family.kind[i]]

    return FamilyFunctions(
        LatticeFamily, neighbour, mate, bond, influence, common, whole, shape, weight, area, family_area
    )


@functools.cache
def cloud_functions(bits, module):
    """Functions of the cloud layout: tables [member, point]."""
    types = numeric(bits)
    real, vec2, vec3 = types.real, types.vec2, types.vec3

    @functools.partial(wp.struct, module=module)
    class CloudFamily:
        members: wp.int32
        words: wp.int32
        neighbours: wp.array2d(dtype=wp.int32)
        mates: wp.array2d(dtype=wp.int32)
        bonds: wp.array2d(dtype=vec2)
        influences: wp.array2d(dtype=real)
        commons: wp.array3d(dtype=wp.uint32)
        wholes: wp.array2d(dtype=wp.uint32)
        shapes: wp.array2d(dtype=vec3)
        weights: wp.array2d(dtype=real)
        areas: wp.array(dtype=real)
        family_areas: wp.array(dtype=real)

    @wp.func(module=module)
    def neighbour(family: CloudFamily, i: int, k: int):
        return family.neighbours[k, i]

    @wp.func(module=module)
    def mate(family: CloudFamily, i: int, k: int):
        return family.mates[k, i]

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
    def whole(family: CloudFamily, i: int, word: int):
        return family.wholes[word, i]

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
        CloudFamily, neighbour, mate, bond, influence, common, whole, shape, weight, area, family_area
    )


@functools.cache
def family_functions(layout, bits, module):
    """Functions of `layout`, "lattice" or "cloud"."""
    return lattice_functions(bits, module) if layout == "lattice" else cloud_functions(bits, module)
