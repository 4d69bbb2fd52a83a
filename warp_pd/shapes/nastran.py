"""Meshes of Nastran bulk data files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError

# Kind and number of corners of each element; midside nodes follow the corners.
ELEMENTS = {
    **dict.fromkeys(("CTRIA3", "CTRIA6", "CTRIAR"), ("triangle", 3)),
    **dict.fromkeys(("CQUAD", "CQUAD4", "CQUAD8", "CQUADR", "CSHEAR"), ("quad", 4)),
    **dict.fromkeys(("CBAR", "CBEAM", "CROD", "CTUBE", "CBUSH", "CGAP"), ("line", 2)),
}
OTHERS = ("CTRI", "CTRAX", "CQUAD", "CTETRA", "CPYRA", "CPENTA", "CHEXA")
# Of 1.5-3, a number whose exponent has no letter.
EXPONENT = re.compile(r"(?<=[\d.])(?=[+-])")


def read_nastran(path: Path) -> Any:
    """Read grid points and elements as a meshio mesh; the property of an element is its group.

    Raises:
        InputError: for grid points in a coordinate system of their own, that occur twice or are missing, and for
            elements that are no surface.
    """
    import meshio

    where = f"path = {str(path)!r}"
    points: dict[int, list[float]] = {}
    elements: dict[str, list[list[int]]] = {}
    groups: dict[str, list[int]] = {}
    for name, words in _cards(path):
        if name in ("GRID", "GRDSET") and words[1] not in ("", "0"):
            raise InputError(f"{where}: {name} {words[0]}: coordinate system {words[1]}: expected the basic one, 0")
        if name == "GRID":
            number = int(words[0])
            position = [_real(word) for word in words[2:5]]
            if points.setdefault(number, position) != position:
                raise InputError(f"{where}: GRID {number} occurs twice: expected one")
        elif name in ELEMENTS:
            kind, corners = ELEMENTS[name]
            nodes = words[2 : 2 + corners]
            # A bar may end at the ground, or at a vector, without a second grid point.
            if kind == "line" and not all(word.isdigit() for word in nodes):
                continue
            elements.setdefault(kind, []).append([int(word) for word in nodes])
            groups.setdefault(kind, []).append(int(words[1] or 0))
        elif name.startswith(OTHERS):
            raise InputError(f"{where}: {name} {words[0]}: expected a surface of {', '.join(list(ELEMENTS)[:8])}")
    order = {number: index for index, number in enumerate(points)}
    for number in {node for rows in elements.values() for row in rows for node in row}:
        if number not in order:
            raise InputError(f"{where}: an element has the point {number}, which is missing")
    return meshio.Mesh(
        np.array(list(points.values())).reshape(-1, 3),
        [(kind, np.array([[order[node] for node in row] for row in rows])) for kind, rows in elements.items()],
        cell_data={"nastran:ref": [np.array(numbers) for numbers in groups.values()]},
    )


def _real(word: str) -> float:
    word = word.upper().replace("D", "E")
    return float(word if "E" in word else EXPONENT.sub("E", word) or 0.0)


def _cards(path: Path) -> Iterator[tuple[str, list[str]]]:
    """Name and fields of each card: of 8 or (names that end with a star) 16 columns, or separated by commas."""
    name, words = "", list[str]()
    lines = [line.partition("$")[0].rstrip() for line in path.read_text(encoding="latin-1").splitlines()]
    begins = [index for index, line in enumerate(lines) if line.upper().split()[:2] == ["BEGIN", "BULK"]]
    for line in filter(None, lines[begins[0] + 1 if begins else 0 :]):
        if line.upper().startswith("INCLUDE"):
            if name:
                yield name, [*words, *[""] * 8]
            name, words = "", []
            yield from _cards(path.parent / line[7:].strip().strip("'\""))
            continue
        first, fields = _fields(line)
        if first and first[0] not in "+*":
            if name:
                yield name, [*words, *[""] * 8]
            name, words = first.rstrip("*").strip(), []
            if name == "ENDDATA":
                return
        words += fields
    if name:
        yield name, [*words, *[""] * 8]


def _fields(line: str) -> tuple[str, list[str]]:
    if "," in line:
        words = [word.strip() for word in line.split(",")]
        first, size = words[0].upper(), 4 if "*" in words[0] else 8
        return first, [*words[1 : 1 + size], *[""] * (size + 1 - len(words))]
    line = line.expandtabs(8)
    first, width = line[:8].strip().upper(), 16 if "*" in line[:8] else 8
    return first, [line[start : start + width].strip() for start in range(8, 72, width)]
