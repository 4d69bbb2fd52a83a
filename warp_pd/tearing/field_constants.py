"""Constants of a damage field: length, strength, sweeps, and where a sheet may store more than the strength."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any, TypeAlias

import numpy as np
import warp as wp

from ..context import Context
from ..device.checks import InputError
from ..interfaces import BuiltLaw

# Energy density [J/m^3] at principal stretches.
Density: TypeAlias = Callable[[np.ndarray, np.ndarray], np.ndarray]

# Default length divided by the spacing, and its minimum divided by the horizon; see docs/tearing.md.
DEFAULT_LENGTH, LEAST_DEFAULT = 4.0, 1.25
# Smallest length divided by the horizon; with a shorter length damage would not reach all families cut by a tear.
MIN_LENGTH = 0.75
# A tear takes 1 + BIAS[0] x + BIAS[1] x^2 times the tearing energy of the field, x = horizon / length, because families
# average over the horizon and bonds break column by column. Fitted to strips with three horizons and five grids;
# tools/tip_problem.py finds the same with nothing fitted, see docs/tearing.md.
BIAS = (0.12, 0.075)
# Factor within which a length is the one that a note would ask for.
SAME = 1.01
# Factor by which half of the sweeps reduce all errors but the smoothest, which take longer.
REDUCED = 3.0


def relaxations(sweeps: int) -> list[float]:
    """Relaxation factors of sweeps: the square of a Chebyshev polynomial reduces the error.

    The square keeps the sign of the error: overshoot would be irreversible damage. For a sheet of lower strength the
    sweeps are (nonlinear) Newton steps, which approach from below without relaxation factors.
    """
    quarter = 0.25 / np.cosh(np.arccosh(REDUCED) / (sweeps // 2)) ** 2
    found = [1.0, 1.0 / (1.0 - 2.0 * quarter)]
    while len(found) < sweeps // 2:
        found.append(1.0 / (1.0 - quarter * found[-1]))
    return 2 * found[: sweeps // 2]


def bias(ratio: float) -> float:
    """Energy of a tear divided by the tearing energy of the field; `ratio`: horizon divided by length."""
    return 1.0 + BIAS[0] * ratio + BIAS[1] * ratio**2


class FieldConstants:
    """Constants of a damage field, from the tearing energy and the length or strength of intact material.

    Attributes:
        resolved: Shortest length that the spacing resolves [m].
        length: Length of the field [m].
        bias: See `bias` [-].
        units: Energy density of the field [J/m^3]: 3 Gc / (8 length), divided by `bias`; a number, or one value per
            point of the whole sheet, (N,).
        limit: Energy density at which intact material begins to tear [J/m^3], the minimum over all points.
        largest_limit: The maximum [J/m^3].
        steepness: -dg/dd at d = 0, see kernels/rupture.py; 2 if the strength follows from the length.

    Args:
        energy: Tearing energy [J/m^2], a number or one value per point, (N,).
        length: `TearingEnergy.length` [m], or None.
        strength: `TearingEnergy.strength` [J/m^3], or None.
        stretch_at_break: `TearingEnergy.stretch_at_break` [-], or None.
        horizon: Horizon [m].
        density: Energy density of the sheet [J/m^3] at principal stretches, see `BuiltLaw.energy_density`.
        spacing: Spacing of the sheet [m].
        extent: Diagonal of the sheet [m].
        longest: Length that cuts near each other have room for [m].
    """

    def __init__(
        self,
        energy: float | np.ndarray,
        length: float | None,
        strength: float | None,
        stretch_at_break: float | None,
        horizon: float,
        density: Density,
        spacing: float,
        extent: float,
        longest: float = float("inf"),
    ) -> None:
        self._least_energy, self._horizon, self._spacing = float(np.min(energy)), horizon, spacing
        self._strength = strength if stretch_at_break is None else energy_at_break(density, stretch_at_break)
        self._given_length = length
        self.resolved = max(min(DEFAULT_LENGTH * spacing, longest), LEAST_DEFAULT * self._horizon)
        least = MIN_LENGTH * self._horizon
        if length is not None and length < least:
            raise InputError(
                f"TearingEnergy.length = {length:g}: expected {least:.3g} m or more at a horizon of "
                f"{self._horizon:.3g} m; {self.resolved:.3g} m is recommended"
            )
        self.length = max(self.wanted_length() or 0.0, self.resolved) if length is None else length
        if self.length > extent:
            raise InputError(
                f"TearingEnergy: its length is {self.length:.3g} m; expected a length shorter than the sheet, "
                f"{extent:.3g} m, or a higher strength"
            )
        self.bias = bias(self._horizon / self.length)
        self.units = 3.0 * energy / (8.0 * self.length * self.bias)
        unit = float(np.min(self.units))
        self.limit = 0.5 * unit
        if length is not None and self._strength is not None:
            if self._strength > self.limit:
                raise InputError(
                    f"TearingEnergy.strength = {self._strength:.4g} J/m^3 at a length of {length:.3g} m: expected at "
                    f"most {self.limit:.4g} J/m^3, or a shorter length"
                )
            self.limit = self._strength
        self.steepness = unit / self.limit
        self.largest_limit = self.limit * float(np.max(self.units)) / unit

    def softened(self, damage: np.ndarray) -> np.ndarray:
        """1 - sqrt(g) for an array of damage, see kernels/tearing/damage_field.py."""
        part = self.steepness * damage * (1.0 + min(1.0, 1.5 * (self.steepness - 2.0) - 0.5) * damage)
        return np.asarray(1.0 - (1.0 - damage) / np.sqrt((1.0 - damage) ** 2 + part))

    def wanted_length(self) -> float | None:
        """Length that follows from the strength [m]; None without a strength, or if a length is given."""
        if self._strength is None or self._given_length is not None:
            return None
        # length * bias(length) = 3 Gc / (16 strength)
        whole = 3.0 * self._least_energy / (16.0 * self._strength) - BIAS[0] * self._horizon
        # A power overflows with an error of Python, a product does not.
        return 0.5 * (whole + float(np.sqrt(max(whole * whole - 4.0 * BIAS[1] * self._horizon**2, 0.0))))

    @property
    def strong(self) -> bool:
        """Whether a strength is given, and intact material has it."""
        wanted = self.wanted_length()
        return self._strength is not None and (wanted is None or wanted >= self.resolved)

    def reached(self, height: float) -> float:
        """G / Gc at which a strip in pure shear between clamps `height` apart [m] reaches the strength, by G = H W."""
        return height * self.limit / self._least_energy

    def remedy(self, longest: float) -> str:
        """What a length of at most `longest` [m] needs."""
        if longest >= self.resolved:
            return f"expected a length of at most {longest:.2g} m"
        spacing = self._spacing * longest / self.resolved
        return f"expected a length of at most {longest:.2g} m, which needs a spacing of {spacing:.2g} m"

    def resolving_length(self) -> float:
        """Length that follows from the strength [m] on a sheet whose spacing just resolves that length."""
        strength = self._strength or self.limit
        return 3.0 * self._least_energy / (16.0 * strength * bias(self._horizon / self.resolved))

    def notes(self) -> list[str]:
        """Notes on the length and strength in use."""
        upto = f" to {0.5 * self.units.max():.4g}" if isinstance(self.units, np.ndarray) else ""
        chosen = self._strength is not None or self._given_length is not None
        hint = "" if chosen else " (chosen from the spacing; strength=, stretch_at_break= or length= sets it)"
        said = [
            f"the damage field of TearingEnergy has a length of {self.length:.4g} m: intact material begins to tear at "
            f"{self.limit:.4g}{upto} J/m^3{hint}"
        ]
        wanted = self.wanted_length()
        if wanted is not None and SAME * wanted < self.resolved:
            needed = self.resolving_length()
            said.append(
                f"the strength needs a length of {needed:.3g} m, which needs a spacing of "
                f"{self._spacing * needed / self.resolved:.3g} m: intact material is weaker than specified, cracks are "
                f"not affected"
            )
        return said


def energy_at_break(density: Density, stretch: float) -> float:
    """Energy density at a uniaxial stretch [J/m^3]: the minimum over the transverse stretch."""
    widths = np.geomspace(1.0 / stretch, 1.0, 2000)
    return float(np.nanmin(density(np.full_like(widths, stretch), widths)))


# Excess of a tear over the tearing energy of its seam above which a note says so: tears of even sheets have as much.
MIXED = 0.05


def narrow_seam(energy: np.ndarray, places: np.ndarray, spacing: float, length: float, resolved: float) -> list[str]:
    """Note if the energy is low over a width less than that damaged by a tear (2 lengths to each side); else none.

    Args:
        energy: Tearing energy of each point [J/m^2], shape (N,).
        places: The points [m], shape (N, 2) or (N, 3).
        spacing: Spacing of the sheet [m].
        length: Length of the damage field [m].
        resolved: The length that the spacing resolves [m].
    """
    from scipy.optimize import brentq
    from scipy.spatial import cKDTree

    weak = energy < np.sqrt(energy.min() * energy.max())
    if not weak.any():
        return []
    half = float(cKDTree(places[~weak]).query(places[weak])[0].max()) - 0.5 * spacing
    ratio = float(np.median(energy[~weak]) / np.median(energy[weak]))
    factor = seam_energy(ratio, half / length)
    if factor <= 1.0 + MIXED:
        return []
    needed = half / brentq(lambda width: seam_energy(ratio, width) - 1.0 - MIXED, 0.0, 2.0)
    if length <= SAME * needed:
        return []
    return [
        f"the tearing energy is low over a width of {2.0 * half:.3g} m, and a tear damages {4.0 * length:.3g} m: it "
        f"takes about {factor:.3g} times the energy there; {1.0 + MIXED:g} times with a length of {needed:.3g} m, "
        f"which a spacing of {spacing * needed / resolved:.3g} m resolves"
    ]


def seam_energy(ratio: float, half: float) -> float:
    """Minimum energy of a tear in the middle of a straight seam, divided by the tearing energy of the seam.

    The energy of the field with d = 1 in the middle is minimal for d'' = 1/2 (in units of the length), with a kink at
    the edge of the seam, and d = d' = 0 at the end of the damage. `ratio` is the tearing energy beside the seam over
    that in it, `half` half the width of the seam over the length.
    """
    if half >= 2.0:
        return 1.0
    beyond = np.sqrt((ratio * half) ** 2 + 4.0 - half**2) - ratio * half
    slope = -0.5 * (ratio * beyond + half)
    damage = half + 0.5 * slope * half**2 + (half**3 + ratio * beyond**3) / 12.0
    return float(0.75 * (0.5 * damage - slope))


# Fraction of the limit of the energy density that no bond reaches outside the stretches that are looked at.
SCREEN = 0.8
# Members that the screen looks at one by one, and the margin for round-off when it does.
FEW, ROUND_OFF = 4, 1e-4


def screen_of(law: BuiltLaw, context: Context, owner: str, limit: float) -> tuple[dict[str, Any], int]:
    """Tables by which `wake` looks at bonds, and the number of members that it checks without families, or 0.

    Args:
        law: The law.
        context: Arrays of the sheet.
        owner: Owner of the array of members.
        limit: Energy density at which intact material begins to tear [J/m^3], the minimum over all points.
    """
    members, shortest, longest = _looked_at(law, context, limit)
    checked = context.array("looked_at", owner, wp.int32, members, per="table")
    values: dict[str, Any] = {"members": checked, "shortest": shortest, "longest": longest}
    families, few = law.families, 0
    if families.shift is not None and families.bonds is not None and len(members) <= FEW:
        few, at, vector = len(members), np.resize(members, 4), context.types.parameters
        x, y = families.horizon * families.bonds[at].T
        squared = x**2 + y**2
        values["shifts"] = wp.vec4i(families.shift[at].tolist())
        values["x"], values["y"] = vector(x.tolist()), vector(y.tolist())
        values["least"] = vector(((1.0 - ROUND_OFF) * shortest * squared).tolist())
        values["most"] = vector(((1.0 + ROUND_OFF) * longest * squared).tolist())
    return values, few


def _looked_at(law: BuiltLaw, context: Context, limit: float) -> tuple[np.ndarray, float, float]:
    """Members to check for high energy, and the squared stretches between which the energy is low.

    On a lattice the shortest bonds in four directions are enough: every direction is within 22.5 degrees of one of
    them.
    """
    stiffness = context.whole.stiffness
    stiffest = 1.0 if stiffness is None else float(stiffness.max())
    allowed = SCREEN * limit / stiffest
    steps, shorter = law.families.steps, np.geomspace(1.0, 1e-3, 400)
    over = ~(law.energy_density(shorter, shorter) <= allowed)
    low = float(shorter[max(int(np.argmax(over)) - 1, 0)]) if over.any() else 0.0
    first, second = np.meshgrid(np.geomspace(1.0, 30.0, 400), np.append(np.linspace(low, 1.0, 60), np.inf))
    second = np.asarray(np.where(np.isinf(second), first, np.minimum(second, first)))
    high = ~(law.energy_density(first.ravel(), second.ravel()).reshape(first.shape) <= allowed)
    along = np.cos(np.pi / 8.0) ** 2
    if steps is not None and context.layout.kind == "lattice":
        members = [k for k, step in enumerate(steps.tolist()) if step in ([1, 0], [0, 1], [1, 1], [-1, 1])]
        seen = along * first**2 + (1.0 - along) * second**2
        longest = float(seen[high].min()) if high.any() else np.inf
        if len(members) == 4 and longest > 1.05:
            return np.array(members), along * low**2 if low > 0.0 else 0.0, longest
    longest = float((first**2)[high].min()) if high.any() else np.inf
    return np.arange(law.families.members), low**2, longest


def principal_stretches(context: Context) -> tuple[np.ndarray, np.ndarray]:
    """Larger and smaller principal stretch of each triangle in the initial displacement [-], each of shape (F,)."""
    sheet = context.sheet
    now = sheet.positions + context.initial_displacement
    before, after = (_metric(at[sheet.triangles]) for at in (sheet.positions, now))
    # Eigenvalues of before^-1 after, from trace and determinant.
    determinant = _determinant(before)
    trace = (before[1] * after[0] + before[0] * after[1] - 2.0 * before[2] * after[2]) / determinant
    product = _determinant(after) / determinant
    apart = np.sqrt(np.maximum(0.25 * trace**2 - product, 0.0))
    larger = 0.5 * trace + apart
    return np.sqrt(larger), np.sqrt(product / np.maximum(larger, 1e-300))


def _metric(corners: np.ndarray) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Squares and scalar product of two sides of triangles of shape (F, 3, 3)."""
    a, b = corners[:, 1] - corners[:, 0], corners[:, 2] - corners[:, 0]
    return (a * a).sum(axis=1), (b * b).sum(axis=1), (a * b).sum(axis=1)


def _determinant(metric: tuple[np.ndarray, np.ndarray, np.ndarray]) -> np.ndarray:
    return np.asarray(metric[0] * metric[1] - metric[2] ** 2)


def density_at_start(context: Context, law: BuiltLaw) -> np.ndarray:
    """Mean energy density of the triangles around each point at the start [J/m^3], (N,); 0 without triangles."""
    sheet = context.sheet
    density = np.nan_to_num(law.energy_density(*principal_stretches(context)), nan=0.0, posinf=0.0)
    corners = sheet.triangles.ravel()
    found = np.bincount(corners, np.repeat(density, 3), sheet.size)
    mean = found / np.maximum(np.bincount(corners, minlength=sheet.size), 1)
    return np.asarray(mean if sheet.stiffness is None else mean * sheet.stiffness)
