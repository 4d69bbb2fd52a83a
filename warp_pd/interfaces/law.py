"""What a force law is, as a user gives it and on a device."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, Protocol, runtime_checkable

import numpy as np
import warp as wp

from ..context import Context
from ..device.fields import Array
from ..device.launches import Stage
from ..families import Families
from .built_part import BuiltPart


class BuiltLaw(BuiltPart, Protocol):
    """A force law on a device.

    Attributes:
        weights: Weights in use, for the summary.
        has_energy: Whether it reports an energy, normally one whose gradient is minus the force.
        horizon_ratio: Horizon in spacings of the sheet [-].
        families: The families on the host.
        struct: The families on the device, a Warp struct (kernels/families.py).
        intact: Bits of the intact bonds, (words, N) uint32, or None if bonds cannot break.
        constants: Constants of the material.
        point_values: Values of the points that replace the last constant, (N,), which parts may change; or None.
        unit_volume: Thickness times reference area [m^3].
        correction: Report on the correction of the weights for the summary, or None.
        earlier_energy: Warp function of the energy of a family at an earlier time, for laws with an energy.
        driving_energy: The same for the part that drives a damage field; None if it is the whole.
        energy_constants: The constants that these take.
        partial_energy: Warp function of what every n-th member adds to this energy, if the law has one.
        represented: Warp function of the area that the intact bonds of a family represent, see
            kernels/family_sums.py; None for a law without one.
        resists_bending: Whether the slope of the sheet can be held.
        needs_finest: Why the law cannot be built on coarser sheets, as text of a message; "" if it can.
        goes_slack: Whether the material carries nothing in compression.
        slack_stiffness: Stiffness that the material keeps where it is slack [Pa].
        slack_frequency: Upper bound on the frequency with the fictitious mass in any state, for a law that may be
            stiffer in other states, such as a bimodular one; None for other laws.
        slack_force: Loads and reactions [N] that count as none where relaxation finds a sheet slack; 0 for other laws.
        other_families: The families that are not undamaged, a struct `OtherFamilies` of
            kernels/tearing/damage_field.py, if a kernel of its own computes the others and bonds can break; else None.
        damage: What `soften` was given, (N,), or None.
    """

    weights: str
    has_energy: bool
    horizon_ratio: float
    families: Families
    struct: Any
    intact: Array | None
    constants: Any
    point_values: Array | None
    unit_volume: float
    correction: dict[str, float] | None
    earlier_energy: wp.Function | None
    driving_energy: wp.Function | None
    energy_constants: Any
    partial_energy: wp.Function | None
    represented: wp.Function | None
    resists_bending: bool = False
    needs_finest: str
    goes_slack: bool
    slack_stiffness: float
    slack_frequency: float | None
    slack_force: float
    other_families: Any | None = None
    damage: Array | None = None

    @property
    def strain_energy(self) -> Array | None:
        """Energy of each family at the last frame [J], (N,) float64; None for a law without an energy."""
        ...

    @property
    def force_path(self) -> str:
        """Name of its force path, for the plan."""
        return "reference"

    def add_force(self, stage: Stage, displacement: Array, out: Array) -> None:
        """Add the launches that fill `out` with the internal force [N] at a displacement [m], both (N,) vec3."""
        ...

    def screen_with_force(self, stage: Stage, squared_stretch: float, exceeding: Array) -> bool:
        """Add a launch that computes the force and flags blocks of points whose bonds may break, if the law has one.

        Args:
            stage: Stage in which bonds break.
            squared_stretch: Squared stretch |Y|^2/|X|^2 [-] below which no bond breaks.
            exceeding: Output, one entry per block of SCREENED points: 1 if a bond ahead of one of them may break, else
                0.

        Returns:
            Whether a launch was added.
        """
        return False

    def bond_force(self) -> Array:
        """Force of each family on its pairs [N], (members, N) vec3, of the last force; InputError without one."""
        ...

    def soften(self, damage: Array, near: Array) -> None:
        """Reduce the stiffness of each family by the damage of its point, (N,); see kernels/tearing/damage_field.py.

        `near`, (N,) uint8, is not 0 at all points that have damage in their family.

        Raises:
            InputError: if the law does not support it.
        """
        ...

    def represented_areas(self) -> np.ndarray:
        """Area represented by the bonds of each point [m^2], shape (N,)."""
        ...

    def energy_density(self, stretch: np.ndarray, across: Any = 1.0) -> np.ndarray:
        """Energy density [J/m^3] at stretches, and across them (by default 1: pure shear); InputError without one."""
        ...

    def on_coarser(self, context: Context, horizon: float) -> BuiltLaw | None:
        """Build the law on a coarser sheet, with the horizon in its spacings, for multigrid; None if not supported."""
        return None

    def request_fields(self, names: Sequence[str]) -> None:
        """Add fields of the law to the frames.

        Raises:
            InputError: for names that the law does not offer.
        """
        ...

    def add_shown(self, stage: Stage, shown: Any) -> None:
        """Add the launches that fill point fields of the law, `ShownFields` of laws/point_fields.py."""
        ...

    def field_names(self) -> Sequence[str]:
        """Names of the fields that `request_fields` accepts."""
        return ()

    def fingerprint(self) -> str:
        """Hash of the values of user functions at fixed arguments; restarts must use the same functions."""
        return ""

    def likely_cause(self, safety: float) -> str:
        """The likely cause if a dynamic run diverged, and a safety of the step to try."""
        ...


@runtime_checkable
class Law(Protocol):
    """A force law, which maps displacements to forces. A frozen dataclass."""

    @property
    def material(self) -> Any:
        """The material."""
        ...

    @property
    def horizon(self) -> float:
        """Horizon in spacings of the sheet [-]."""
        ...

    def build(self, context: Context) -> BuiltLaw:
        """Build families, tables and kernels on a device."""
        ...
