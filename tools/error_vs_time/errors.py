"""Fields of finite elements at any place, and how far a run is from them."""

from __future__ import annotations

from collections.abc import Callable, Mapping

import numpy as np
import numpy.typing as npt
from study import REFERENCES

from warp_pd import Frame, Result, Sheet

Array = npt.NDArray[np.float64]
Frames = Mapping[float, Frame]
# Points (n, 2) [m] -> displacements [m], NaN where the reference has none.
Field = Callable[[Array], Array]
# Of a scalar, and of the field in the L2 norm, if it is known.
Errors = tuple[float, float | None]
# Largest load of scene double_notch [N], by elements.py; 11.06, 11.13, 11.12 mN with 107, 213, 427 points.
NOTCHED_LOAD = 11.12e-3


def interpolated(nodes: Array, displacement: Array, points: Array) -> Array:
    """A finite-element field at points of its quarter or half: by splines on a grid, by piecewise cubics elsewhere."""
    from scipy.interpolate import CloughTocher2DInterpolator, RectBivariateSpline

    # Points on the edge may lie outside by a rounding error.
    points = np.clip(points, nodes.min(axis=0), nodes.max(axis=0))
    x, y = (np.unique(nodes[:, c].round(9)) for c in (0, 1))
    if len(x) * len(y) != len(nodes):
        return CloughTocher2DInterpolator(nodes, displacement, rescale=True)(points)
    order = np.lexsort((nodes[:, 1].round(9), nodes[:, 0].round(9)))
    values = displacement[order].reshape(len(x), len(y), -1)
    splines = [RectBivariateSpline(x, y, values[..., c]) for c in range(values.shape[2])]
    return np.column_stack([spline.ev(points[:, 0], points[:, 1]) for spline in splines])


def mirrored(nodes: Array, displacement: Array, points: Array, centre: tuple[float, float], signs: Array) -> Array:
    """A field that is known on one side of lines of symmetry through `centre`.

    Args:
        nodes: Nodes about the centre, (N, 2) [m].
        displacement: Of the nodes [m].
        points: Where the field is wanted, (n, 2) [m].
        centre: Where the nodes have their origin [m].
        signs: 1 for the directions along which the field is known on one side alone, otherwise 0, (2,).
    """
    offset = points - np.array(centre)
    turned = (offset < 0.0) & (signs > 0)
    field = interpolated(nodes, displacement, np.where(turned, -offset, offset))
    field[:, :2] *= np.where(turned, -1.0, 1.0)
    return field


def pressure_field(points: Array) -> Array:
    """Scene `pressure`, (n, 3)."""
    data = np.load(REFERENCES / "pressure.npz")
    moved = data["x"] - np.column_stack([data["X"], np.zeros(len(data["X"]))])
    return mirrored(data["X"], moved, points, (0.05, 0.05), np.array([1, 1]))


def tension_field(points: Array) -> Array:
    """Scene `tension`, (n, 2)."""
    data = np.load(REFERENCES / "tension.npz")
    return mirrored(data["X"], data["x"] - data["X"], points, (0.0, 0.05), np.array([0, 1]))


def dynamic_field(points: Array, time: float) -> Array:
    """Scene `pressure_dynamic` at 0.25, 0.5, 0.75 or 1 s, (n, 3)."""
    data = np.load(REFERENCES / "pressure_dynamic_20Pa.npz")
    moved = data[f"x_t{time}"] - np.column_stack([data["X"], np.zeros(len(data["X"]))])
    return mirrored(data["X"], moved, points, (0.5, 0.5), np.array([1, 1]))


def hole_field(points: Array) -> Array:
    """Scene `stretch` with a hole, at twice its size in both directions, (n, 2); NaN in the hole and outside."""
    nodes, moved = whole_sheet_with_hole()
    field = interpolated(nodes, moved, points)
    # The mesh is straight between the nodes of its hole, and splines do not reach outside the nodes.
    field[(np.hypot(*points.T) < 0.08) | (np.abs(points) > 0.25 * (1.0 + 1e-9)).any(axis=1)] = np.nan
    return field


def whole_sheet_with_hole() -> tuple[Array, Array]:
    """Nodes [m] and displacements [m] of the finite elements, mirrored to the whole sheet: (N, 2) each."""
    data = np.load(REFERENCES / "stretch_hole.npz")
    quarter, moved = data["equibiaxial_X"], data["equibiaxial_x_lam2"] - data["equibiaxial_X"]
    signs = [np.array(s) for s in ((1, 1), (-1, 1), (-1, -1), (1, -1))]
    nodes, moved = np.vstack([s * quarter for s in signs]), np.vstack([s * moved for s in signs])
    _, first = np.unique(nodes.round(9) + 0.0, axis=0, return_index=True)
    return nodes[first], moved[first]


def distance(found: Array, reference: Array, areas: Array) -> float:
    """Relative L2 norm of the difference of two fields, (n, c), where the reference is finite; areas (n,) [m^2]."""
    here = np.isfinite(reference).all(axis=1)
    a = areas[here, None]
    return float(np.sqrt((a * (found - reference)[here] ** 2).sum() / (a * reference[here] ** 2).sum()))


def of_sheet(sheet: Sheet, displacement: Array, reference: Array) -> float:
    """The same for the points of a sheet."""
    return distance(displacement[:, : reference.shape[1]], reference, sheet.areas)


def static_errors(measure: str, field: Field) -> Callable[[Result, Frames], Errors]:
    """Errors of a measure and of the field at the end."""

    def errors(result: Result, frames: Frames) -> Errors:
        sheet = result.built.simulation.sheet
        scalar = result.summary["measures"][measure]["error"]
        return float(scalar), of_sheet(sheet, result.frame.displacement, field(sheet.points))

    return errors


def dynamic_errors(result: Result, frames: Frames) -> Errors:
    """Root mean square over four times, of the largest deflection and of the field."""
    sheet, found = result.built.simulation.sheet, []
    for time in (0.25, 0.5, 0.75, 1.0):
        scalar = float(result.summary["measures"][f"largest_deflection_at_{time:g}_s"]["error"])
        found.append((scalar, of_sheet(sheet, frames[time].displacement, dynamic_field(sheet.points, time))))
    scalar, field = np.sqrt(np.mean(np.square(found), axis=0))
    return float(scalar), float(field)


def onset_errors(result: Result, frames: Frames) -> Errors:
    """Of G over Gc when the tear has begun.

    Raises:
        ArithmeticError: if it has not.
    """
    onset = result.summary["measures"]["onset_ratio"]["value"]
    if onset is None:
        raise ArithmeticError("does not tear at twice Gc")
    return float(onset) - 1.0, None


def load_errors(result: Result, frames: Frames) -> Errors:
    """Of the largest load of scene `double_notch`."""
    return float(result.summary["measures"]["largest_load"]["value"]) / NOTCHED_LOAD - 1.0, None


def bar_errors(result: Result, frames: Frames) -> Errors:
    """Of the end of scene `bimodular_bar`, and of all its points."""
    measures = result.summary["measures"]
    return float(measures["end_displacement"]["error"]), float(measures["displacement_error"]["value"])


def stress_errors(result: Result, frames: Frames) -> Errors:
    """Of scene `visco_sheet`: the larger error of the stress and of its viscous part."""
    measures = result.summary["measures"]
    return max(abs(float(measures[name]["error"])) for name in ("nominal_stress", "viscous_stress")), None
