"""The runs of the study of the scene `stretch`, see stretch.py."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

from study import Case

from warp_pd.materials.bond_neo_hookean import MODES

LAWS = {
    "bond_based": "published",
    "bond_based_refitted": "refitted",
    "bond_associated": "bond-associated",
}
# How the error falls: points along a side, horizons, and the stretch.
SIZES, HORIZONS, FIRST = (21, 31, 41, 61, 81), (2.015, 3.15), 1.5


@dataclass(frozen=True)
class StretchCase(Case):
    """One run of the scene.

    Attributes:
        mode: How the sheet is loaded.
        defect: What is in its middle.
        force: Force law.
        points: Along a side.
        law: Mode that the law is made for, if it is another one.
        horizon: In spacings, or None for the scene's.
    """

    mode: str
    defect: str
    force: str
    points: int
    law: str = "auto"
    horizon: float | None = None

    scene = "stretch"

    @property
    def settings(self) -> dict[str, Any]:  # type: ignore[override]
        """Arguments of the scene."""
        return {
            "points": self.points, "force": self.force, "mode": self.mode, "defect": self.defect, "law": self.law,
            "stretch": self.last_stretch,
        } | ({} if self.horizon is None else {"horizon": self.horizon})  # fmt: skip

    @property
    def name(self) -> str:
        """Name of the folder of its results."""
        return f"{self.mode}-{self.defect}-{self.force}-{self.law}-{self.points}" + (
            "" if self.horizon is None else f"-{self.horizon:g}"
        )

    @property
    def label(self) -> str:
        """The law in words."""
        return LAWS[self.force] + ("" if self.law == "auto" else f", {self.law} law")

    @property
    def last_stretch(self) -> float:
        """Where the run ends. A sheet without a defect goes further, because its exact force is known."""
        if self.horizon is not None:
            return FIRST
        return 4.0 if self.defect == "none" else 3.0


def cases(points: int, defects: Sequence[str]) -> list[StretchCase]:
    """All runs, the quick ones first."""
    found = []
    for mode in MODES:
        here = points if mode != "uniaxial" else max(30, points // 2)
        for defect in defects:
            found += [StretchCase(mode, defect, force, here) for force in LAWS]
            if defect in ("none", "hole"):
                found += [StretchCase(mode, defect, "bond_based", here, law) for law in MODES if law != mode]
    return sorted(found, key=lambda case: case.mode == "uniaxial")


def refined(defects: Sequence[str], sizes: Sequence[int]) -> list[StretchCase]:
    """Runs of the bond-associated law that show how the error falls with the spacing, the quick ones first."""
    return [
        StretchCase(mode, defect, "bond_associated", size, horizon=horizon)
        for horizon in HORIZONS
        for size in sizes
        for defect in defects
        if defect != "none"
        for mode in ("equibiaxial", "planar")
    ]
