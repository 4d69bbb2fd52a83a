"""Labels and units of point fields and history columns, for pictures and pages."""

from __future__ import annotations

from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

OTHER_UNITS = {"time": "s", "step": "s"}
OTHER_WORDS = {"step": "time step", "balance_error": "energy balance error"}
# Words and unit of point fields; those of the components of a field that is not a vector in space, by number.
FIELDS = {
    "displacement": ("displacement", "m"),
    "u": ("displacement", "m"),
    "velocity": ("velocity", "m/s"),
    "damage": ("damage", ""),
    "joint_damage": ("damage of the joint", ""),
    "strain_energy_density": ("strain energy density", "J/m\u00b3"),
    "stretch_1": ("largest principal stretch", ""),
    "stretch_2": ("smallest principal stretch", ""),
    "first_piola_1": ("largest first Piola stress", "Pa"),
    "first_piola_2": ("smallest first Piola stress", "Pa"),
    "cauchy_1": ("largest Cauchy stress", "Pa"),
    "cauchy_2": ("smallest Cauchy stress", "Pa"),
    "wrinkle_state": ("wrinkle state", "0 taut, 1 wrinkled, 2 slack"),
    "wrinkle_level": ("wrinkle level", ""),
    "stress": ("largest principal stress", "Pa"),
    "thickness": ("thickness over that without stress", ""),
    "principal_stress_1": ("largest principal stress", "Pa"),
    "principal_stress_2": ("smallest principal stress", "Pa"),
    "principal_stress_3": ("angle of the largest principal stress", "rad"),
}
COLUMNS = {
    "kinetic": "kinetic energy",
    "strain": "strain energy",
    "external": "work of loads and supports",
    "damping": "lost to damping",
    "rupture": "lost to tearing",
    "viscous": "lost to viscosity",
    "contact": "energy of the contact",
    "sheet_friction": "lost to friction of the sheet",
    "bending": "energy of bending",
    "bending_lost": "energy of bending lost to tearing",
    "joint": "energy of the joint",
    "joint_released": "lost to breaking of the joint",
}
ENERGIES = tuple(COLUMNS)
UNITS = {
    "force": "N", "torque": "N m", "position": "m", "velocity": "m/s", "spin": "rad/s", "pressure": "Pa",
    "volume": "m\u00b3", "potential": "J", "kinetic": "J", "loss": "J", "rubbed": "J",
    "fracture": "J",
}  # fmt: skip


def field_label(name: str) -> str:
    """Name and unit of a point field, such as "displacement along z (m)" for u3."""
    if name in FIELDS:
        words, unit = FIELDS[name]
        return f"{words} ({unit})" if unit else words
    stem, number = name[:-1].rstrip("_"), name[-1:]
    if stem in ("u", "velocity") and number in ("1", "2", "3"):
        words, unit = FIELDS[stem]
        return f"{words} along {'xyz'[int(number) - 1]} ({unit})"
    return name.replace("_", " ")


def column_label(name: str) -> str:
    """Name of a column of the history, such as "work of loads and supports" for external."""
    return {**COLUMNS, **OTHER_WORDS}.get(name, name.replace("_", " "))


def with_unit(name: str, unit: str = "") -> str:
    """Name of a column with its unit, such as "ball force z (N)"; a unit that is not given comes from the name."""
    unit = column_unit(name) if not unit else unit
    return column_label(name) + ("" if unit in ("", "1", "-") else f" ({unit})")


@dataclass(frozen=True)
class Choice:
    """A scalar for colouring the surface.

    Attributes:
        label: Its name.
        unit: Its SI unit; empty for a dimensionless number.
        field: The point field that it comes from.
        component: Component of the field; None for a scalar field, -1 for the length of a vector.
    """

    label: str
    unit: str
    field: str
    component: int | None = None


def choices(field: str, components: int) -> list[Choice]:
    """The scalars of a point field of 1 or 3 components."""
    words, unit = FIELDS.get(field, (column_label(field), ""))
    if components == 1:
        return [Choice(words, unit, field)]
    if f"{field}_1" in FIELDS:
        return [Choice(*FIELDS[f"{field}_{c + 1}"], field, c) for c in range(components)]
    along = [Choice(f"{words} along {axis}", unit, field, c) for c, axis in enumerate("xyz")]
    return [Choice(words, unit, field, -1), *along]


def known_units(summary: Mapping[str, Any]) -> dict[str, str]:
    """Units of columns of the history given in the summary of a run."""
    measures = {name: str(found["unit"]) for name, found in summary.get("measures", {}).items()}
    return {**summary.get("units", {}), **measures}


def column_unit(name: str, units: Mapping[str, str] = MappingProxyType({})) -> str:
    """Unit of a column of the history, from `units` or its name; empty if it is dimensionless or unknown."""
    if name in units:
        return "" if units[name] in ("1", "-") else units[name]
    if name in ENERGIES:
        return "J"
    ending = name.removesuffix("_x").removesuffix("_y").removesuffix("_z").rpartition("_")[2]
    return {**UNITS, **OTHER_UNITS}.get(name, UNITS.get(ending, ""))


def curves(columns: Sequence[str], measures: Collection[str], units: Mapping[str, str]) -> list[dict[str, Any]]:
    """Group columns of the history into graphs: energies, components of a vector, and single columns.

    Each graph has "label", "unit" and "columns"; the scene's measures come first. The
    kinetic energy at half steps is left out: it is there for the energy balance.
    """
    left = [name for name in columns if name not in ("time", "step", "half_step_kinetic")]
    graphs = [_graph(column_label(name), [name], units) for name in left if name in measures]
    left = [name for name in left if name not in measures]
    vectors = [name[:-2] for name in left if name.endswith("_x") and {name[:-1] + c for c in "yz"} <= set(left)]
    graphs += [_graph(column_label(name), [f"{name}_{c}" for c in "xyz"], units) for name in vectors]
    energies = [name for name in left if name in ENERGIES]
    if energies:
        graphs.append(_graph("energies", energies, units))
    taken = {part["column"] for graph in graphs for part in graph["columns"]}
    return graphs + [_graph(column_label(name), [name], units) for name in left if name not in taken]


def _graph(label: str, columns: Sequence[str], units: Mapping[str, str]) -> dict[str, Any]:
    names = [{"column": name, "label": column_label(name)} for name in columns]
    return {"label": label, "unit": column_unit(columns[0], units), "columns": names}
