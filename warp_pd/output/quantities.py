"""Words and units of point fields and of columns of the history, as a reader of results sees them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

ENERGIES = ("kinetic", "strain", "external", "damping", "rupture", "viscous", "contact", "sheet_friction")

# Words and unit of a point field; unit of a column of the history, by its name or by what it ends with.
FIELDS = {
    "displacement": ("displacement", "m"), "velocity": ("velocity", "m/s"), "damage": ("damage", ""),
    "strain_energy_density": ("strain energy density", "J/m³"),
    "stretch_1": ("largest principal stretch", ""), "stretch_2": ("smallest principal stretch", ""),
    "first_piola_1": ("largest first Piola stress", "Pa"), "first_piola_2": ("smallest first Piola stress", "Pa"),
    "cauchy_1": ("largest Cauchy stress", "Pa"), "cauchy_2": ("smallest Cauchy stress", "Pa"),
    "wrinkle_state": ("wrinkle state", "0 taut, 1 wrinkled, 2 slack"),
}  # fmt: skip
COLUMN_UNITS = {"time": "s", "step": "s", "pressure": "Pa", "volume": "m³", "balance_error": ""}
ENDINGS = {
    "force": "N", "torque": "N m", "position": "m", "velocity": "m/s", "spin": "rad/s", "kinetic": "J",
    "potential": "J", "loss": "J", "rubbed": "J",
}  # fmt: skip
WORDS = {
    "external": "work of loads and supports", "damping": "lost to damping", "rupture": "lost to broken bonds",
    "viscous": "lost to viscosity", "sheet_friction": "lost to friction of the sheet", "step": "time step",
    "balance_error": "energy balance error",
}  # fmt: skip
# Components of a field that is no vector in space.
PARTS = {
    "principal_stress": (
        ("largest principal stress", "Pa"), ("smallest principal stress", "Pa"), ("angle of the largest", "rad"),
    ),
}  # fmt: skip


@dataclass(frozen=True)
class Choice:
    """A scalar that the surface can be coloured by.

    Attributes:
        label: Its name.
        unit: Its SI unit; empty for a plain number.
        field: The point field that it comes from.
        component: Of the field; None for a scalar field, -1 for the length of a vector.
    """

    label: str
    unit: str
    field: str
    component: int | None = None


def choices(field: str, components: int) -> list[Choice]:
    """The scalars of a point field.

    Args:
        field: Its name.
        components: 1 or 3.
    """
    words, unit = FIELDS.get(field, (spoken(field), ""))
    if components == 1:
        return [Choice(words, unit, field)]
    if field in PARTS:
        return [Choice(label, of, field, c) for c, (label, of) in enumerate(PARTS[field])]
    along = [Choice(f"{words} along {axis}", unit, field, c) for c, axis in enumerate("xyz")]
    return [Choice(words, unit, field, -1), *along]


def spoken(name: str) -> str:
    """A name in words."""
    return WORDS.get(name, name.replace("_", " "))


def column_unit(name: str, measures: Mapping[str, Any]) -> str:
    """Unit of a column of the history; empty where none is known.

    Args:
        name: The column.
        measures: Those of the summary.
    """
    if name in measures:
        unit = str(measures[name]["unit"])
        return "" if unit in ("1", "-") else unit
    if name in ENERGIES:
        return "J"
    ending = name.removesuffix("_x").removesuffix("_y").removesuffix("_z").rpartition("_")[2]
    return COLUMN_UNITS.get(name, ENDINGS.get(ending, ""))


def curves(columns: Sequence[str], measures: Mapping[str, Any]) -> list[dict[str, Any]]:
    """Columns of the history that share a graph: energies, components of a vector, and each other one alone.

    Returns:
        For each graph "label", "unit" and "columns", what the scene measures first.
    """
    left = [name for name in columns if name not in ("time", "step")]
    graphs = [_graph(spoken(name), [name], measures) for name in left if name in measures]
    left = [name for name in left if name not in measures]
    vectors = [name[:-2] for name in left if name.endswith("_x") and {name[:-1] + c for c in "yz"} <= set(left)]
    graphs += [_graph(spoken(name), [f"{name}_{c}" for c in "xyz"], measures) for name in vectors]
    energies = [name for name in left if name in ENERGIES]
    if energies:
        graphs.append(_graph("energies", energies, measures))
    taken = {part["column"] for graph in graphs for part in graph["columns"]}
    return graphs + [_graph(spoken(name), [name], measures) for name in left if name not in taken]


def _graph(label: str, columns: Sequence[str], measures: Mapping[str, Any]) -> dict[str, Any]:
    names = [{"column": name, "label": spoken(name)} for name in columns]
    return {"label": label, "unit": column_unit(columns[0], measures), "columns": names}
