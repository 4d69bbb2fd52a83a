"""Protocols of materials: what force laws need, and optional capabilities."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, fields
from typing import TYPE_CHECKING, Any, Protocol

from ..device.checks import InputError, finite, show

if TYPE_CHECKING:
    from ..kernels.numeric import FunctionFactory, PairFactory, PairwiseFactory


class Material(Protocol):
    """A continuum material; any object with these two properties is one.

    `Capabilities` lists optional attributes.
    """

    @property
    def constants(self) -> tuple[float, ...]:
        """Constants for the device functions: up to four, or as many as the functions take."""
        ...

    @property
    def functions(self) -> PairFactory:
        """Cached factory: precision in bits -> Warp functions (stress, energy), see kernels/materials.py."""
        ...


class PairwiseMaterial(Protocol):
    """A material for bond-based laws; any object with these two properties is one."""

    @property
    def constants(self) -> tuple[float, ...]:
        """At most four numbers, passed to the device function; the first is a modulus."""
        ...

    @property
    def pairwise(self) -> PairwiseFactory:
        """Cached factory: precision in bits -> (force, slope, energy), Warp functions; kernels/papers/bond_based.py."""
        ...


@dataclass(frozen=True)
class Capabilities:
    """Optional capabilities of a material; None or False if not available.

    Attributes:
        near: Factory of `stress_near`, for the fast kernels of the bond-associated law.
        isotropic: Whether it is isotropic, for the fastest of these kernels.
        response: Factory of stress and moduli, for Newton's method and the fictitious mass of relaxation.
        membrane: Factory of (volume_change, shear), for the neural law.
        mu: Unit of stress of the neural law [Pa].
        ratios: Ratios of constants that determine the stress divided by mu, for the neural law.
        lock: Locking parameter Jm [-].
        width: Factory of the width in uniaxial tension, for `TensionField`.
        volume: Factory of (G, constants) -> J^2 - 1, for the Cauchy stress.
        wrinkle_width: Factory of the width at which it wrinkles, for a material of tension field theory.
        notes: Notes on its constants for the summary of a run, one line each.
        doubts: Constants that cannot be meant, each with what may be, for the note on sizes.
        shear_modulus: Shear modulus at rest [Pa]; that of others follows from their energy.
        stable: Whether its constants tell that it is stable at any stretch; others are checked by their energy.
        goes_slack: Whether it carries no compression.
        resisting: Of a material of tension field theory, the material that resists compression.
        slack_stiffness: Stiffness that it keeps where it is slack [Pa].
        materials: All materials of a ByRegion.
        regions: Its pairs of points and their material.
        by_point: Values that replace its last constant, by point: a number, an array of shape (N,), or a function of
            the point coordinates as for `Sheet`.
        remembers: Cached factory of (G, constants) -> a number. Its largest value so far in each intersection replaces
            the last constant: an internal variable, which starts at `by_point`, or 0. It grows in every step, and in
            every frame of a static solver.
        one_modulus: Whether a pairwise material is as stiff in compression as in tension.
    """

    near: FunctionFactory | None = None
    isotropic: bool = False
    response: FunctionFactory | None = None
    membrane: PairFactory | None = None
    mu: float | None = None
    ratios: Mapping[str, float] | None = None
    lock: float | None = None
    width: FunctionFactory | None = None
    volume: FunctionFactory | None = None
    wrinkle_width: FunctionFactory | None = None
    notes: tuple[str, ...] = ()
    doubts: Sequence[str] = ()
    shear_modulus: float | None = None
    stable: bool = False
    goes_slack: bool = False
    resisting: Material | None = None
    slack_stiffness: float = 0.0
    materials: Sequence[Material] = ()
    regions: Sequence[tuple[Any, Material]] = ()
    by_point: Any = None
    remembers: FunctionFactory | None = None
    one_modulus: bool = False


def capabilities(material: Any) -> Capabilities:
    """Read the capabilities of a material from its attributes, and from its functions `on_device`."""
    sources = (getattr(material, "on_device", None), material)
    names = [field.name for field in fields(Capabilities)]
    return Capabilities(
        **{name: getattr(source, name) for source in sources for name in names if hasattr(source, name)}
    )  # fmt: skip


def check_material(material: Any, kind: str, name: str = "material") -> None:
    """Check that a material is of the kind "functions" (continuum) or "pairwise", and check its constants."""
    example = {"functions": "NeoHookean(mu, bulk)", "pairwise": "Bimodular(modulus)"}[kind]
    if isinstance(material, type) or not hasattr(material, kind):
        raise InputError(f"{name} = {show(material)}: expected a material such as {example} with this law")
    padded_constants(material)


def padded_constants(material: Material | PairwiseMaterial) -> tuple[float, ...]:
    """The constants of `material`, padded with zeros to at least four."""
    if not hasattr(material, "constants"):
        raise InputError(f"material = {material!r}: expected a material, such as NeoHookean(mu, bulk)")
    name = type(material).__name__
    constants = [finite(f"{name}.constants[{k}]", c) for k, c in enumerate(material.constants)]
    if len(constants) > 4 and len(constants) != (taken := _constants_taken(material)):
        raise InputError(f"{name}.constants has {len(constants)} numbers: expected at most {taken}")
    return (*constants, *([0.0] * (4 - len(constants))))


def _constants_taken(material: Any) -> int:
    """Number of constants that a material's device functions take."""
    if not hasattr(material, "functions"):
        return 4
    from ..kernels.numeric import constants_of

    return len(constants_of(material.functions(64)[0])())


def out_of_order(order: str, **beyond: tuple[float, float, str]) -> list[str]:
    """Doubts about constants, each given with its most and what that is, which may be in another order than `order`."""
    return [
        f"{name.replace('__', '.')} = {value:.6g} is more than {what}; are its constants in the order {order}?"
        for name, (value, most, what) in beyond.items()
        if not value <= most
    ]
