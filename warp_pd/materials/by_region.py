"""A sheet of several materials, each in its region."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Any

from ..device.checks import InputError
from .plane_stress import PlaneStress
from .protocols import Capabilities, Material, capabilities, check_material, padded_constants

if TYPE_CHECKING:
    from ..kernels.materials import MaterialFunctions


@dataclass(frozen=True, eq=False)
class ByRegion(PlaneStress):
    """Different materials in regions of one sheet, for `BondAssociated`.

    A region is made of the triangles whose three corners are among its points. Families end at an interface, so that no
    deformation gradient is fitted across a kink: a point on it has a family in every region that it belongs to, and
    its displacement is that of all of them. A region that holds no interface point, such as a piece of `together`,
    has families as if it were alone.

    Attributes:
        material: Where there is no region; any hyperelastic material of continua.
        regions: Pairs of points, indices or a mask, and their material, such as
            `[(sheet.where(lambda x, y: x >= 0.05), Gent(...))]`. An interface runs along edges of triangles, so points
            on it belong to both sides. Regions share no triangle.

    Raises:
        InputError: for what is not a material, has no regions, or pairs of something else.
    """

    material: Material
    regions: Sequence[tuple[Any, Material]]

    def __post_init__(self) -> None:
        if not isinstance(self.regions, Sequence) or not all(
            isinstance(pair, tuple) and len(pair) == 2 for pair in self.regions
        ):
            raise InputError("ByRegion.regions: expected pairs of points and a material, such as [(points, Gent(...))]")
        if not 0 < len(self.regions) < 256:
            raise InputError(f"ByRegion.regions holds {len(self.regions)} regions: expected 1 to 255")
        for k, material in enumerate(self.materials):
            check_material(material, "functions", f"ByRegion.regions[{k - 1}][1]" if k else "ByRegion.material")
            if capabilities(material).regions:
                raise InputError("ByRegion: expected a material of one kind in each region, got another ByRegion")

    @property
    def materials(self) -> tuple[Material, ...]:
        """The material without a region, and those of the regions."""
        return (self.material, *(material for _, material in self.regions))

    @property
    def _known(self) -> list[Capabilities]:
        return [capabilities(material) for material in self.materials]

    @property
    def constants(self) -> tuple[float, ...]:
        """Those of all materials, and the index of one, for kernels/by_region.py."""
        return (*(number for material in self.materials for number in padded_constants(material)), 0.0)

    @property
    def isotropic(self) -> bool:  # type: ignore[override]
        """Whether all are."""
        return all(known.isotropic for known in self._known)

    @property
    def goes_slack(self) -> bool:
        """Whether none carries anything in compression."""
        return all(known.goes_slack for known in self._known)

    @property
    def lock(self) -> float | None:
        """The least lock [-]; None without one."""
        return min((known.lock for known in self._known if known.lock is not None), default=None)

    @property
    def notes(self) -> tuple[str, ...]:
        """Those of all materials."""
        return tuple(dict.fromkeys(note for known in self._known for note in known.notes))

    @property
    def on_device(self) -> MaterialFunctions:
        """Warp functions that take the material of a bond, made by `kernels.by_region.by_region`."""
        from ..kernels.by_region import by_region
        from ..kernels.materials import MaterialFunctions

        return by_region(
            tuple(
                MaterialFunctions(material.functions, known.near, known.response, known.volume)
                for material, known in zip(self.materials, self._known, strict=True)
            )
        )
