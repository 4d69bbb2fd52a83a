"""Interpretation of the columns of a data file for a scene."""

from __future__ import annotations

import inspect
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError
from ..run.simulation import Simulation
from .data import (
    DIMENSIONS,
    DISPLACEMENTS,
    MOST_STRETCH,
    PLACES,
    Curve,
    FieldData,
    Table,
    Test,
    dimension_of,
    read_table,
    require_stretches,
    si_unit,
)
from .experiment import require_arguments

CONTROLS = ("time", "load_factor")


def read_tests(
    file: str | Path | Table,
    build: Callable[..., Simulation],
    measure: str | None,
    settings: Mapping[str, Any] | None = None,
) -> tuple[list[Test], list[str]]:
    """Read the tests in a file (or its table) for a scene, and notes on skipped rows, one line each.

    A file with columns x, y (and z), u, v (and w) is a displacement field; another column may be an argument of the
    scene, which gives one field per value. Any other file is a curve: one column is the control, i.e. an argument of
    the scene, "time" or "load_factor"; the measured column is named `measure`, or is the only other column.

    Raises:
        InputError: if the names or units of columns do not fit the scene.
    """
    table = file if isinstance(file, Table) else read_table(file)
    arguments = tuple(inspect.signature(build).parameters)
    control = _control(table, arguments, measure)
    require_arguments(build, settings or {})
    scene = build(**(settings or {}))
    if {"x", "y"} <= set(table.columns) and set(DISPLACEMENTS) & set(table.columns):
        return list(_fields(table, control)), table.notes
    if control is None:
        raise InputError(
            f"{table.path.name}: columns {', '.join(table.columns)}: expected one named as an argument of the scene, "
            "'time' or 'load_factor'; or 'uniaxial', 'equibiaxial' or 'planar', the stretch of a uniform test"
        )
    name, column = _measured(table, control, measure, scene)
    unit = next((m.unit for m in scene.measures if m.name == name), "")
    _check_dimensions(table, control, column, dimension_of(unit))
    values, rows = table.without_gaps([control, column])
    if len(rows) == 0:
        raise InputError(f"{table.path.name}: expected rows with both {control} and {column}")
    if "stretch" in control and table.dimensions[control] == "ratio":
        require_stretches(f"{table.path.name}: column {control!r}", values[control])
    elif "strain" in control and np.abs(values[control]).max() > MOST_STRETCH:
        raise InputError(
            f"{table.path.name}: column {control!r}: strains up to {np.abs(values[control]).max():g}: expected the "
            "unit [%] for percents"
        )
    units = (si_unit(table.dimensions[control]), unit or si_unit(table.dimensions[column]))
    curve = Curve(control, values[control], name, values[column], name=table.path.stem, rows=rows, units=units)
    return [curve], table.notes


def _control(table: Table, arguments: tuple[str, ...], measure: str | None) -> str | None:
    found = [c for c in table.columns if (c in arguments or c in CONTROLS) and c != measure]
    if len(found) > 1:
        raise InputError(f"{table.path.name}: columns {', '.join(found)} are arguments of the scene: expected one")
    return found[0] if found else None


def _measured(table: Table, control: str, measure: str | None, scene: Simulation) -> tuple[str, str]:
    """Name of the measure, and of its column."""
    others = [c for c in table.columns if c != control]
    known = [m.name for m in scene.measures]
    if not known and measure is None:
        raise InputError(f"{table.path.name}: the scene has no measures: expected one to compare with, or --measure")
    if not others:
        raise InputError(f"{table.path.name}: expected a column beside {control!r}, of one of {', '.join(known)}")
    column = measure if measure in others else None
    if column is None:
        named = [c for c in others if c in known]
        column = named[0] if len(named) == 1 and measure is None else others[0] if len(others) == 1 else None
    if column is None:
        raise InputError(
            f"{table.path.name}: columns {', '.join(others)}: expected one called "
            f"{measure or 'as a measure of the scene is, and no other'}"
        )
    name = measure or column
    if measure is None and column not in known:
        raise InputError(
            f"{table.path.name}: column {column!r}: expected a measure of the scene: {', '.join(known)}; or name it "
            "with measure = (--measure)"
        )
    return name, column


def _check_dimensions(table: Table, control: str, column: str, wanted: str | None) -> None:
    """Check the dimensions of the columns against those of the scene."""
    expected = {control: DIMENSIONS.get(control), column: wanted}
    for name, other in ((control, column), (column, control)):
        dimension, right = table.dimensions[name], expected[name]
        if right is None or dimension == right:
            continue
        crossed = table.dimensions[other] == right and dimension == expected[other]
        hint = "; the columns seem to be reversed" if crossed else ""
        raise InputError(f"{table.path.name}: column {name!r} is a {dimension}: expected a {right}{hint}")


def _fields(table: Table, control: str | None) -> list[FieldData]:
    for name in (*PLACES, *DISPLACEMENTS):
        if table.dimensions.get(name, "length") != "length":
            raise InputError(f"{table.path.name}: column {name!r} is a {table.dimensions[name]}: expected a length")
    places = [c for c in PLACES if c in table.columns]
    values, rows = table.without_gaps([*places, *([control] if control else [])])
    whole = np.isin(table.rows, rows)
    shift = np.column_stack([table.columns.get(c, np.full(len(whole), np.nan))[whole] for c in DISPLACEMENTS])
    where = np.column_stack([values[c] for c in places])
    levels = np.unique(values[control]) if control else np.array([1.0])
    made = []
    for level in levels:
        mine = values[control] == level if control else np.ones(len(rows), bool)
        empty = np.isnan(shift).all(axis=1) & mine
        for row in rows[empty]:
            table.notes.append(f"{table.path.name}, line {row}: the displacement is missing: the row is left out")
        mine &= ~empty
        made.append(
            FieldData(where[mine], shift[mine], control or "", float(level), name=table.path.stem, rows=rows[mine])
        )
    return made
