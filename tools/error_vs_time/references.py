"""Errors of a run against finite elements, or against a finer run."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np
import numpy.typing as npt
from stretch import elements
from study import REFERENCES

from warp_pd import Frame, Result, Sheet
from warp_pd.interfaces import History

Array = npt.NDArray[np.float64]
Frames = Mapping[float, Frame]
Errors = tuple[float, float]


def interpolated(nodes: Array, displacement: Array, points: Array) -> Array:
    """A finite-element field at points of its quarter or half: by splines on a grid, by piecewise cubics elsewhere."""
    from scipy.interpolate import CloughTocher2DInterpolator, RectBivariateSpline

    low, high = nodes.min(axis=0), nodes.max(axis=0)
    # Points on the edge may lie outside by a rounding error.
    points = np.clip(points, low, high)
    x, y = (np.unique(nodes[:, c].round(9)) for c in (0, 1))
    if len(x) * len(y) != len(nodes):
        return CloughTocher2DInterpolator(nodes, displacement, rescale=True)(points)
    order = np.lexsort((nodes[:, 1].round(9), nodes[:, 0].round(9)))
    values = displacement[order].reshape(len(x), len(y), -1)
    splines = [RectBivariateSpline(x, y, values[..., c]) for c in range(values.shape[2])]
    return np.column_stack([spline.ev(points[:, 0], points[:, 1]) for spline in splines])


def field_error(sheet: Sheet, found: Array, reference: Array) -> float:
    """Relative L2 norm of the difference of two displacement fields, where the reference is finite."""
    here = np.isfinite(reference).all(axis=1)
    a = sheet.areas[here, None]
    return float(np.sqrt((a * (found - reference)[here] ** 2).sum() / (a * reference[here] ** 2).sum()))


def quarter_field(nodes: Array, displacement: Array, points: Array, centre: tuple[float, float]) -> Array:
    """A field that is known on the quarter x, y >= 0 about `centre`, at all points by symmetry."""
    offset = points - np.array(centre)
    field = interpolated(nodes, displacement, np.abs(offset))
    field[:, :2] *= np.where(offset < 0.0, -1.0, 1.0)
    return field


def measured_error(result: Result, name: str) -> float:
    """Relative error of a measure."""
    return float(result.summary["measures"][name]["error"])


def pressure_errors(result: Result, frames: Frames, finer: History) -> Errors:
    """Deflection of the centre; the field."""
    data = np.load(REFERENCES / "pressure.npz")
    sheet = result.built.simulation.sheet
    moved = data["x"] - np.column_stack([data["X"], np.zeros(len(data["X"]))])
    reference = quarter_field(data["X"], moved, sheet.points, (0.05, 0.05))
    return measured_error(result, "center_deflection"), field_error(sheet, result.frame.displacement, reference)


def tension_errors(result: Result, frames: Frames, finer: History) -> Errors:
    """Contraction of the free edge; the field."""
    data = np.load(REFERENCES / "tension.npz")
    sheet = result.built.simulation.sheet
    offset = sheet.points - np.array([0.0, 0.05])
    field = interpolated(data["X"], data["x"] - data["X"], np.column_stack([offset[:, 0], np.abs(offset[:, 1])]))
    field[:, 1] *= np.where(offset[:, 1] < 0.0, -1.0, 1.0)
    return measured_error(result, "edge_contraction"), field_error(sheet, result.frame.displacement[:, :2], field)


def dynamic_errors(result: Result, frames: Frames, finer: History) -> Errors:
    """Root mean square over four times, of the largest deflection and of the field."""
    data = np.load(REFERENCES / "pressure_dynamic_20Pa.npz")
    sheet = result.built.simulation.sheet
    nodes = np.column_stack([data["X"], np.zeros(len(data["X"]))])
    scalars, fields = [], []
    for time in (0.25, 0.5, 0.75, 1.0):
        reference = quarter_field(data["X"], data[f"x_t{time}"] - nodes, sheet.points, (0.5, 0.5))
        fields.append(field_error(sheet, frames[time].displacement, reference))
        scalars.append(measured_error(result, f"largest_deflection_at_{time:g}_s"))
    return float(np.sqrt(np.mean(np.square(scalars)))), float(np.sqrt(np.mean(np.square(fields))))


def tear_errors(result: Result, frames: Frames, finer: History) -> Errors:
    """Largest load; L2 norm of load over extension. The reference is the history of a finer run."""
    (extension, load), (finer_extension, finer_load) = (
        [np.array([row[name] for row in history]) for name in ("extension", "load")]
        for history in (result.history, finer)
    )
    at = np.linspace(0.0, min(extension[-1], finer_extension[-1]), 400)
    found, reference = np.interp(at, extension, load), np.interp(at, finer_extension, finer_load)
    field = float(np.linalg.norm(found - reference) / np.linalg.norm(reference))
    return float(load.max() / finer_load.max()) - 1.0, field


def hole_errors(result: Result, frames: Frames, finer: History) -> Errors:
    """Force on an edge; the field outside the hole and inside the sheet."""
    known = elements("equibiaxial", 2.0)
    assert known is not None
    sheet = result.built.simulation.sheet
    field = interpolated(*known, sheet.points)
    x, y = sheet.points.T
    field[(np.hypot(x, y) < 0.08) | (np.abs(sheet.points) > 0.25 * (1.0 + 1e-9)).any(axis=1)] = np.nan
    return measured_error(result, "edge_force"), field_error(sheet, result.frame.displacement[:, :2], field)
