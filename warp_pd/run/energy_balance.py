"""The energy balance of a run, from its history; see kernels/integrate.py for the kinetic energy that it uses."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

Row = Mapping[str, float]


def balance_error(history: Sequence[Row], row: Row) -> float:
    """(Energy now - energy first - work + losses) over the largest energy or work so far.

    Args:
        history: Rows of earlier frames.
        row: The newest row, with all energies.
    """
    first = history[0] if history else row
    kinetic = "half_step_kinetic" if "half_step_kinetic" in row else "kinetic"
    change = row[kinetic] + row["strain"] - first[kinetic] - first["strain"]
    error = change - row["external"] + row["damping"] + row["rupture"] + row.get("viscous", 0.0)
    if "contact" in row:
        error += row["contact"] - first["contact"] + row.get("sheet_friction", 0.0)
    if "viscous" in row:
        error -= first["viscous"]
    rows = [*history, row]
    scale = max(max(abs(r["external"]), abs(r["kinetic"] + r["strain"])) for r in rows)
    return error / scale if scale > 0.0 else 0.0
