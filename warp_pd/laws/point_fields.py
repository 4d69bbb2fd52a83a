"""Point fields that force laws offer for frames: stretches, stresses, wrinkle state, bond counts."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import warp as wp

from ..context import Context
from ..device.checks import InputError, one_of
from ..device.fields import Array
from ..device.launches import Stage, with_values
from ..interfaces import BuiltLaw
from ..interfaces.frame import OWN_FIELDS
from ..kernels.effects import Kernel
from ..kernels.families import Layout
from ..kernels.numeric import FunctionFactory, PairFactory
from ..materials import Capabilities, Material, capabilities

# Names that a scene or a user gives, and the arrays that frames then hold.
KINEMATIC = {"stretch": ("stretch_1", "stretch_2"), "direction": ("stretch_direction",)}
STRESSES = {"first_piola": ("first_piola_1", "first_piola_2"), "cauchy": ("cauchy_1", "cauchy_2")}
WRINKLES = {"wrinkle_state": ("wrinkle_state",)}
BONDS = {"bonds": ("intact_bonds", "broken_bonds")}
GROUPS = {**KINEMATIC, **STRESSES, **WRINKLES, **BONDS}
OWNER = "fields"


def offered(context: Context, stress: Material | None) -> tuple[str, ...]:
    """Names of the fields that a law offers; `stress` is the material of the stress fields, or None."""
    lattice = context.sheet.lattice
    if lattice is not None and lattice.rows == 1:
        return tuple(BONDS)
    known: dict[str, Any] = {**KINEMATIC, **BONDS}
    if stress is not None:
        known |= {"first_piola": (), **WRINKLES}
        if capabilities(stress).volume is not None:
            known |= {"cauchy": ()}
    return tuple(name for name in GROUPS if name in known)


def grouped(names: Sequence[str]) -> list[str]:
    """Unique group names ("stretch" for "stretch_1"), in the order of GROUPS, followed by names without a group."""
    of = {array: group for group, arrays in GROUPS.items() for array in arrays}
    asked = [of.get(name, name) for name in names]
    return [name for name in GROUPS if name in asked] + [name for name in asked if name not in GROUPS]


def refuse_other(names: Sequence[str], known: Sequence[str], law: str, shown: Sequence[str]) -> None:
    """Check that a law offers the requested fields; `shown` are those that frames always have, for the message."""
    for name in names:
        if name not in known:
            if name in GROUPS:
                raise InputError(
                    f"fields = {name!r}: the law {law} has no such field; expected one of {', '.join(known)}"
                )
            one_of("fields", name, tuple(dict.fromkeys((*OWN_FIELDS, *shown, *known))))


class ShownFields:
    """The requested fields of a law, each with its array.

    Args:
        context: Context of the law.
        law: The built law.
        names: Group names.
    """

    def __init__(self, context: Context, law: BuiltLaw, names: Sequence[str]) -> None:
        from ..kernels.point_fields import Wanted

        self.context, self.law = context, law
        self.wanted = Wanted(
            stretch="stretch" in names, direction="direction" in names, piola="first_piola" in names,
            cauchy="cauchy" in names, state="wrinkle_state" in names,
        )  # fmt: skip
        self.counts = "bonds" in names
        self.arrays: dict[str, Array] = {}
        types = {"stretch_direction": context.types.vec3, **dict.fromkeys((*WRINKLES, *BONDS["bonds"]), wp.int32)}
        for name in (array for group in names for array in GROUPS[group]):
            dtype = types.get(name, context.types.real)
            self.arrays[name] = context.array(name, OWNER, dtype, shape=context.sheet.size, output=name)

    def add_principal(self, stage: Stage, kernel: Kernel, **more: Any) -> None:
        """Add the launch of a kernel of principal values if any are wanted."""
        from ..kernels.point_fields import Wanted, field_arrays

        if self.wanted == Wanted():
            return
        Fields = field_arrays(self.context.bits)
        fields = with_values(Fields(), {name: self.arrays.get(name) for name in Fields.vars})
        stage.launch(
            OWNER, kernel, self.context.sheet.size, family=self.law.struct,
            displacement=self.context.state.displacement, constants=self.law.constants, **more, fields=fields,
        )  # fmt: skip

    def stresses(self) -> list[Array]:
        """Arrays of the wanted stresses [Pa]."""
        names = [name for group in STRESSES for name in GROUPS[group]]
        return [self.arrays[name] for name in names if name in self.arrays]

    def add_counts(self, stage: Stage) -> None:
        """Add the launch that counts bonds if the counts are wanted."""
        if not self.counts:
            return
        context = self.context
        from ..kernels.point_fields import bond_counts

        kernel = bond_counts(context.layout)
        stage.launch(
            OWNER, kernel, self.context.sheet.size, family=self.law.struct,
            intact_count=self.arrays["intact_bonds"], broken_count=self.arrays["broken_bonds"],
        )  # fmt: skip

    def of_family(self, material: Material | None) -> Kernel:
        """Kernel for one gradient per family, with the stress of `material` if it is not None."""
        context, known = self.context, capabilities(material)
        functions = None if material is None else material.functions
        from ..kernels.point_fields import point_fields

        return point_fields(context.layout, functions, known.volume, known.wrinkle_width, self.wanted)

    def of_bonds(
        self, key: tuple[Layout, PairFactory, str], material: Material, response: FunctionFactory | None
    ) -> Kernel:
        """Kernel for means over bonds, for a law with one gradient per bond; arguments as for `bond_fields`."""
        known: Capabilities = capabilities(material)
        stiffened = self.context.sheet.stiffness is not None
        from ..kernels.point_fields import bond_fields

        return bond_fields(*key, known.volume, known.wrinkle_width, stiffened, self.wanted, response)


def factors(context: Context) -> Array | None:
    """Factor on the moduli of each point, (N,), or None on a uniform sheet."""
    stiffness = context.sheet.stiffness
    if stiffness is None:
        return None
    return context.array("stiffness_factors", OWNER, context.types.real, stiffness)
