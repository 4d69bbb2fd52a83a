"""Keep the cells: the numbers beside the page."""

from __future__ import annotations

import json
from collections.abc import Mapping
from dataclasses import asdict
from pathlib import Path

from warp_pd import InputError
from warp_pd.run.folder import write_atomically

from .cases import CASES
from .laws import LAWS
from .verdicts import Cell, Table


def load(path: Path) -> Table:
    """The cells of earlier calls; none if there is no file."""
    if not path.exists():
        return {}
    return {name: {law: Cell(**c) for law, c in row.items()} for name, row in json.loads(path.read_text()).items()}


def require_device(cells: Table, device: str, path: Path) -> None:
    """Compare the device of earlier calls with that of this one.

    Raises:
        InputError: if they differ.
    """
    made = sorted({c.made for row in cells.values() for c in row.values()})
    if not all(text.startswith(f"on {device},") for text in made):
        raise InputError(f"--out: {path} holds results made {made[0]!r}; expected another page for {device!r}")


def in_order(cells: Mapping[str, Mapping[str, Cell]]) -> Table:
    """The cells in the order of the cases and laws."""
    rows = {case.name: cells[case.name] for case in CASES if case.name in cells}
    return {name: {law: row[law] for law in LAWS if law in row} for name, row in rows.items()}


def save(path: Path, cells: Table) -> None:
    """Write the numbers."""
    numbers = {name: {law: asdict(c) for law, c in row.items()} for name, row in cells.items()}
    path.parent.mkdir(parents=True, exist_ok=True)
    write_atomically(path, json.dumps(numbers, indent=1) + "\n")
