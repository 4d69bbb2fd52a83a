"""Different materials in different regions of a sheet."""

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

    A region consists of the triangles whose three corners are among its points. Families end at an interface, so no
    deformation gradient is fitted across a kink. A point on an interface has a family in each adjacent region, and one
    displacement. A region without interface points, such as a piece of `together`, has the same families as a separate
    sheet.

    Attributes:
        material: Material outside all regions; any hyperelastic continuum material.
        regions: Pairs of points (indices or a mask) and a material, such as
            `[(sheet.where(lambda x, y: x >= 0.05), Gent(...))]`. An interface runs along edges of triangles, so points
            on it belong to both sides. Regions must not overlap.

    Raises:
        InputError: if a material is not one, or the regions are not 1 to 255 pairs of points and a material.
    """

    material: Material
    regions: Sequence[tuple[Any, Material]]

    def __post_init__(self) -> None:
        if not isinstance(self.regions, Sequence) or not all(
            isinstance(pair, tuple) and len(pair) == 2 for pair in self.regions
        ):
            raise InputError("ByRegion.regions: expected pairs of points and a material, such as [(points, Gent(...))]")
        if not 0 < len(self.regions) < 256:
            raise InputError(f"ByRegion.regions: expected 1 to 255 regions, got {len(self.regions)}")
        for k, material in enumerate(self.materials):
            check_material(material, "functions", f"ByRegion.regions[{k - 1}][1]" if k else "ByRegion.material")
            known = capabilities(material)
            if known.regions or known.by_point is not None or known.remembers is not None:
                what = "another ByRegion" if known.regions else "values by point or an internal variable"
                raise InputError(f"ByRegion: expected a single material in each region, got {what}")

    @property
    def materials(self) -> tuple[Material, ...]:
        """The material outside the regions, then those of the regions."""
        return (self.material, *(material for _, material in self.regions))

    @property
    def _known(self) -> list[Capabilities]:
        return [capabilities(material) for material in self.materials]

    @property
    def constants(self) -> tuple[float, ...]:
        """Constants of all materials, and the index of the first one, for kernels/materials.py."""
        return (*(number for material in self.materials for number in padded_constants(material)), 0.0)

    @property
    def isotropic(self) -> bool:  # type: ignore[override]
        """Whether all materials are isotropic."""
        return all(known.isotropic for known in self._known)

    @property
    def goes_slack(self) -> bool:
        """Whether no material carries compression."""
        return all(known.goes_slack for known in self._known)

    @property
    def slack_stiffness(self) -> float:
        """The smallest of the materials [Pa]."""
        return min(known.slack_stiffness for known in self._known)

    @property
    def lock(self) -> float | None:
        """The smallest `lock` of the materials [-]; None if no material has one."""
        return min((known.lock for known in self._known if known.lock is not None), default=None)

    @property
    def notes(self) -> tuple[str, ...]:
        """Notes of all materials."""
        return tuple(dict.fromkeys(note for known in self._known for note in known.notes))

    @property
    def on_device(self) -> MaterialFunctions:
        """Warp functions that select the material of a bond, from `kernels.materials.by_region`."""
        from ..kernels.materials import MaterialFunctions, by_region

        return by_region(
            tuple(
                MaterialFunctions(material.functions, known.near, known.response, known.volume)
                for material, known in zip(self.materials, self._known, strict=True)
            )
        )
