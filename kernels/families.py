"""Families of bonds in three layouts, accessed through the same functions.

Lattice: all points share one stencil. Points with the same neighbourhood form a family class (`family_class`) and share
one row of a small table: bits, shape tensors, weights, area. Cloud: every point has its own row. Grid: the deep points
of a square grid, whose families and those of all their members are complete, share row 0; every other point has a
separate row. A grid may have gaps, so index shifts are not constant. But the members of a deep point in one grid line
are consecutive, and `centres` stores the one straight above or below the point.

A cloud may be curved: its points lie on a surface in space. xi is then the projection of the bond on the tangent plane
of its point, in the point's frame Q = (e1, e2, normal), and the bond itself is the chord X = Q (xi, rise).

Lengths are in units of the horizon: xi = X / horizon. Areas are in units of one reference area, the mean
area of a point. Every tabulated number is therefore of order one in any system of units, which suits float32.

Masks of members have words of 32 bits. A loop over the members of a mask

    members = ...                                   bits of one word
    while members != wp.uint32(0):
        k = word * WORD + lowest_bit(members)       member index
        members = without_lowest_bit(members)
        ...

visits them in ascending order, so sums are reproducible bit for bit.
"""

import functools
from dataclasses import dataclass, replace
from typing import Any

import warp as wp

from .numeric import Numeric, entry_of, numeric

WORD = 32


@dataclass(frozen=True)
class Layout:
    """How the families of a sheet are stored, and whether their bonds can break or soften.

    Attributes:
        kind: "lattice", "grid" or "cloud".
        bits: Precision, 32 or 64.
        curved: Whether the points of a cloud lie on a surface in space.
        breakable: Whether bonds can break.
        softened: Whether the damage of a point reduces the stiffness of its family, see
            kernels/tearing/damage_field.py.
        regions: Whether bonds have several materials, see kernels/materials.py.
        by_point: Whether the last constant of the material is a value of the point.
        remembers: Whether it is a value of the intersection instead, see kernels/bond_associated.py.
    """

    kind: str
    bits: int
    curved: bool = False
    breakable: bool = False
    softened: bool = False
    regions: bool = False
    by_point: bool = False
    remembers: bool = False

    @property
    def varies(self) -> bool:
        """Whether constants of the material vary, over the sheet or in time."""
        return self.regions or self.by_point or self.remembers

    @property
    def types(self) -> Numeric:
        """Types of the precision."""
        return numeric(self.bits)


@dataclass(frozen=True)
class FamilyFunctions:
    """Warp functions of one layout; `family` is its struct, i a point, k a member of the family of i.

    Attributes:
        struct: The Warp struct that holds the tables, the horizon [m] and its inverse, and the bits `intact`
            [words, points] of the intact bonds, if bonds can break.
        neighbour: (family, i, k) -> index of the member's point; invalid for members that do not exist.
        reverse: (family, i, k) -> member index of the reverse bond, i.e. of i in the family of k; invalid likewise.
        bond: (family, i, k) -> xi_ik, vec2.
        influence: (family, i, k) -> w_ik.
        shape: (family, i, k) -> inverse of K_ik of the undamaged sheet: components 11, 12, 22.
        common: (family, i, k, word) -> bits of the members that are also within the horizon of k.
        initial: (family, i, word) -> bits of the members that exist in the undamaged sheet.
        weight: (family, i, k) -> W_ik divided by the reference area.
        area: (family, i) -> a_i divided by the reference area.
        entry: (family, i, k) -> index, of 32 bits, of the entry of a contiguous table [members, rows].
        family_area: (family, i) -> undamaged |H_i| divided by the reference area.
        chord: (family, i, k) -> X of the bond in space, divided by the horizon: vec3 if curved, otherwise xi, vec2.
        rise: (family, i, k) -> height of the member above the tangent plane divided by the horizon; zero if flat.
        tilt: (family, i, k) -> tilt of the undamaged intersection against the tangent plane, vec2, see
            kernels/kinematics.py; zero if flat.
        to_frame: (family, i, v) -> components in the frame of i of a vector v in space; v itself if flat.
        from_frame: (family, i, v) -> the inverse.
        intact_members: (family, i, word) -> bits of the members whose bonds are intact.
        is_undamaged: (family, i) -> whether no bond of i is broken; the tables of the undamaged sheet are then valid.
        is_intact: (family, i, k) -> whether the bond is intact.
        of_bond: (family, i, k, constants of a material) -> the same, whose last one is the index of the bond's material
            (kernels/materials.py), the value of point i or that of the intersection; or the constants themselves.
    """

    struct: Any
    neighbour: wp.Function
    reverse: wp.Function
    bond: wp.Function
    influence: wp.Function
    shape: wp.Function
    common: wp.Function
    initial: wp.Function
    weight: wp.Function
    area: wp.Function
    entry: wp.Function
    family_area: wp.Function
    chord: wp.Function
    rise: wp.Function
    tilt: wp.Function
    to_frame: wp.Function
    from_frame: wp.Function
    intact_members: wp.Function
    is_undamaged: wp.Function
    is_intact: wp.Function
    of_bond: wp.Function


@functools.cache
def same_constants(Family: Any) -> wp.Function:
    """`of_bond` for a sheet with one material, whose bonds all have the same constants."""

    @wp.func
    def of_bond(family: Family, i: int, k: int, constants: Any):
        return constants

    return of_bond


def bond_functions(layout: Layout, Family: Any, initial: wp.Function) -> dict[str, Any]:
    """Functions `intact_members`, `is_undamaged` and `is_intact`; they read `intact` only if bonds can break."""
    breakable, word_size = layout.breakable, WORD

    @wp.func
    def intact_members(family: Family, i: int, word: int):
        if wp.static(breakable):
            return family.intact[word, i]
        else:
            return initial(family, i, word)

    @wp.func
    def is_undamaged(family: Family, i: int):
        answer = bool(True)
        if wp.static(breakable):
            for word in range(family.words):
                if family.intact[word, i] != initial(family, i, word):
                    answer = False
        return answer

    @wp.func
    def is_intact(family: Family, i: int, k: int):
        word = k // word_size
        return bit_of(intact_members(family, i, word), k - word * word_size)

    return {"intact_members": intact_members, "is_undamaged": is_undamaged, "is_intact": is_intact}


def flat_functions(layout: Layout, Family: Any) -> dict[str, Any]:
    """Functions `rise`, `tilt`, `to_frame` and `from_frame` of a flat sheet."""
    types = layout.types
    real, vec2, vec3 = types.real, types.vec2, types.vec3

    @wp.func
    def rise(family: Family, i: int, k: int):
        return real(0.0)

    @wp.func
    def tilt(family: Family, i: int, k: int):
        return vec2(real(0.0), real(0.0))

    @wp.func
    def same(family: Family, i: int, v: vec3):
        return v

    return {"rise": rise, "tilt": tilt, "to_frame": same, "from_frame": same}


def lattice_functions(layout: Layout) -> FamilyFunctions:
    """Functions of a lattice: tables [row of the family class, member]."""
    types = layout.types
    real, vec2, vec3 = types.real, types.vec2, types.vec3

    @wp.struct
    class LatticeFamily:
        members: wp.int32
        words: wp.int32
        horizon: real
        inverse_horizon: real
        intact: wp.array2d(dtype=wp.uint32)
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

    @wp.func
    def neighbour(family: LatticeFamily, i: int, k: int):
        return i + family.stencil_shift[k]

    @wp.func
    def reverse(family: LatticeFamily, i: int, k: int):
        return family.stencil_reverse[k]

    @wp.func
    def bond(family: LatticeFamily, i: int, k: int):
        return family.stencil_bond[k]

    @wp.func
    def influence(family: LatticeFamily, i: int, k: int):
        return family.stencil_influence[k]

    @wp.func
    def common(family: LatticeFamily, i: int, k: int, word: int):
        return family.stencil_common[k, word]

    @wp.func
    def initial(family: LatticeFamily, i: int, word: int):
        return family.class_initial[family.family_class[i], word]

    @wp.func
    def shape(family: LatticeFamily, i: int, k: int):
        return family.class_shape[family.family_class[i], k]

    @wp.func
    def weight(family: LatticeFamily, i: int, k: int):
        return family.class_weight[family.family_class[i], k]

    @wp.func
    def area(family: LatticeFamily, i: int):
        return family.class_area[family.family_class[i]]

    @wp.func
    def entry(family: LatticeFamily, i: int, k: int):
        return wp.uint32(k * family.class_area.shape[0] + family.family_class[i])

    @wp.func
    def family_area(family: LatticeFamily, i: int):
        return family.class_family_area[family.family_class[i]]

    return FamilyFunctions(
        LatticeFamily, neighbour, reverse, bond, influence, shape, common, initial, weight, area, entry, family_area,
        chord=bond, **flat_functions(layout, LatticeFamily), **bond_functions(layout, LatticeFamily, initial),
        of_bond=same_constants(LatticeFamily),
    )  # fmt: skip


def curved_functions(layout: Layout, Family: Any) -> dict[str, Any]:
    """Functions `chord`, `rise`, `tilt`, `to_frame` and `from_frame` of a curved cloud."""
    vec3 = layout.types.vec3

    @wp.func
    def chord(family: Family, i: int, k: int):
        return family.chords[k, i]

    @wp.func
    def rise(family: Family, i: int, k: int):
        Q = family.frames[i]
        X = family.chords[k, i]
        return Q[0, 2] * X[0] + Q[1, 2] * X[1] + Q[2, 2] * X[2]

    @wp.func
    def tilt(family: Family, i: int, k: int):
        return family.tilts[k, i]

    @wp.func
    def to_frame(family: Family, i: int, v: vec3):
        return wp.transpose(family.frames[i]) * v

    @wp.func
    def from_frame(family: Family, i: int, v: vec3):
        return family.frames[i] * v

    return {"chord": chord, "rise": rise, "tilt": tilt, "to_frame": to_frame, "from_frame": from_frame}


def row_functions(layout: Layout, Family: Any, row_of: wp.Function) -> dict[str, Any]:
    """Functions of a cloud or a grid that read tables [member, row]: entry, common, initial, weight, areas."""
    number_of, mask_of = entry_of(layout.types.real, 2, wp.uint32), entry_of(wp.uint32, 3, wp.int64)

    @wp.func
    def entry(family: Family, i: int, k: int):
        return wp.uint32(k) * wp.uint32(family.rows) + wp.uint32(row_of(family, i))

    @wp.func
    def common(family: Family, i: int, k: int, word: int):
        return mask_of(
            family.commons, wp.int64(k * family.words + word) * wp.int64(family.rows) + wp.int64(row_of(family, i))
        )

    @wp.func
    def initial(family: Family, i: int, word: int):
        return family.initials[word, row_of(family, i)]

    @wp.func
    def weight(family: Family, i: int, k: int):
        return number_of(family.weights, entry(family, i, k))

    @wp.func
    def area(family: Family, i: int):
        return family.areas[row_of(family, i)]

    @wp.func
    def family_area(family: Family, i: int):
        return family.family_areas[row_of(family, i)]

    return {
        "entry": entry, "common": common, "initial": initial, "weight": weight, "area": area, "family_area": family_area
    }  # fmt: skip


def table_functions(layout: Layout) -> FamilyFunctions:
    """Functions of a cloud or a grid: tables [member, row]."""
    types = layout.types
    gridded, by_point, remembers = layout.kind == "grid", layout.by_point, layout.remembers
    real, vec2, vec3 = types.real, types.vec2, types.vec3

    index_of, triple_of = entry_of(wp.int32, 2, wp.uint32), entry_of(vec3, 2, wp.uint32)

    # Members that a layout does not need have no array.
    @wp.struct
    class Family:
        members: wp.int32
        words: wp.int32
        horizon: real
        inverse_horizon: real
        intact: wp.array2d(dtype=wp.uint32)
        rows: wp.int32
        family_class: wp.array(dtype=wp.int32)
        centres: wp.array2d(dtype=wp.int32)
        stencil_line: wp.array(dtype=wp.int32)
        stencil_right: wp.array(dtype=wp.int32)
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
        frames: wp.array(dtype=types.mat33)
        chords: wp.array2d(dtype=vec3)
        tilts: wp.array2d(dtype=vec2)
        materials: wp.array2d(dtype=wp.uint8)
        point_values: wp.array(dtype=real)
        remembered: wp.array2d(dtype=real)

    @wp.func
    def row_of(family: Family, i: int):
        if wp.static(gridded):
            return family.family_class[i]
        else:
            return i

    of_rows = row_functions(layout, Family, row_of)
    entry = of_rows["entry"]

    @wp.func
    def neighbour(family: Family, i: int, k: int):
        row = row_of(family, i)
        if wp.static(gridded):
            if row == 0:
                return family.centres[family.stencil_line[k], i] + family.stencil_right[k]
        return index_of(family.neighbours, entry(family, i, k))

    @wp.func
    def reverse(family: Family, i: int, k: int):
        return index_of(family.reverses, entry(family, i, k))

    @wp.func
    def bond(family: Family, i: int, k: int):
        return family.bonds[k, row_of(family, i)]

    @wp.func
    def influence(family: Family, i: int, k: int):
        return family.influences[k, row_of(family, i)]

    @wp.func
    def shape(family: Family, i: int, k: int):
        return triple_of(family.shapes, entry(family, i, k))

    @wp.func
    def of_bond(family: Family, i: int, k: int, constants: Any):
        own = type(constants)(constants)
        if wp.static(by_point):
            own[-1] = family.point_values[i]
        elif wp.static(remembers):
            own[-1] = family.remembered[k, i]
        else:
            own[-1] = real(family.materials[k, i])
        return own

    in_space = curved_functions(layout, Family) if layout.curved else {"chord": bond, **flat_functions(layout, Family)}
    return FamilyFunctions(
        Family, neighbour, reverse, bond, influence, shape, **of_rows, **in_space,
        **bond_functions(layout, Family, of_rows["initial"]),
        of_bond=of_bond if layout.regions or by_point or remembers else same_constants(Family),
    )  # fmt: skip


@functools.cache
def family_functions(layout: Layout) -> FamilyFunctions:
    """Functions of a layout, the same whether or not its bonds soften."""
    if layout.softened:
        return family_functions(replace(layout, softened=False))
    return lattice_functions(layout) if layout.kind == "lattice" else table_functions(layout)


_LOWEST = """
#if defined(__CUDA_ARCH__)
    return __ffs(static_cast<int>(mask)) - 1;
#else
    return __builtin_ctz(mask);
#endif
"""

_NUMBER = """
#if defined(__CUDA_ARCH__)
    return __popc(mask);
#else
    return __builtin_popcount(mask);
#endif
"""


@wp.func_native(_LOWEST)
def lowest_bit(mask: wp.uint32) -> int:
    """Index of the lowest set bit; undefined for 0."""
    ...


@wp.func_native(_NUMBER)
def number_of_bits(mask: wp.uint32) -> int:
    """Number of set bits."""
    ...


@wp.func
def without_lowest_bit(mask: wp.uint32):
    """The mask with its lowest set bit cleared."""
    return mask & (mask - wp.uint32(1))


@wp.func
def bit_of(mask: wp.uint32, index: int):
    """Whether a bit, 0 to 31, is set."""
    return ((mask >> wp.uint32(index)) & wp.uint32(1)) != wp.uint32(0)
