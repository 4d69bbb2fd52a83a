"""Words and units of point fields and of columns of the history, as a reader of results sees them."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

from .labels import COLUMNS, ENERGIES, FIELDS, UNITS

OTHER_UNITS = {"time": "s", "step": "s"}
OTHER_WORDS = {"step": "time step", "balance_error": "energy balance error"}


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
    if f"{field}_1" in FIELDS:
        return [Choice(*FIELDS[f"{field}_{c + 1}"], field, c) for c in range(components)]
    along = [Choice(f"{words} along {axis}", unit, field, c) for c, axis in enumerate("xyz")]
    return [Choice(words, unit, field, -1), *along]


def spoken(name: str) -> str:
    """A name in words."""
    return {**COLUMNS, **OTHER_WORDS}.get(name, name.replace("_", " "))


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
    return {**UNITS, **OTHER_UNITS}.get(name, UNITS.get(ending, ""))


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
