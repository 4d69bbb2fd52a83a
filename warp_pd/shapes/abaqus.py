"""Meshes of Abaqus and CalculiX .inp files."""

from __future__ import annotations

import re
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError

# Kinds of elements of meshio, by the number of nodes.
LINES = {2: "line", 3: "line3"}
SURFACES = {3: "triangle", 4: "quad", 6: "triangle6", 7: "triangle7", 8: "quad8", 9: "quad9"}
# Names of elements: of shells, membranes, rigid surfaces and in the plane, and along lines.
SURFACE = re.compile(r"(?:CPS|CPEG|CPE|CAX|CGAX|M3D|R3D|SFM3D|STRI|S|DS|DC2D)(\d)")
LINE = re.compile(r"(?:T2D|T3D|R2D|RAX|RB2D|RB3D|SAX|FRAME2D|FRAME3D)(\d)")
# Elements that mean something else than a sheet in their program.
NOT_SHEETS = {"R3D": "rigid elements", "CAX": "axisymmetric elements", "CGAX": "axisymmetric elements"}
# Members that one line of a set may generate.
MOST_MEMBERS = 10_000_000
BEAM = re.compile(r"B[23]([123])")
BEAM_NODES = {"1": 2, "2": 3, "3": 2}


@dataclass
class _Model:
    nodes: dict[int, list[float]] = field(default_factory=dict)
    # Kind and nodes of each element by its number.
    elements: dict[int, tuple[str, list[int]]] = field(default_factory=dict)
    node_sets: dict[str, list[int]] = field(default_factory=dict)
    element_sets: dict[str, list[int]] = field(default_factory=dict)
    # Names of the parts that an assembly has.
    placed: set[str] = field(default_factory=set)
    notes: list[str] = field(default_factory=list)


def read_abaqus(path: Path) -> tuple[Any, list[str]]:
    """Read nodes, elements and their sets, also of several parts whose numbers differ, as a meshio mesh, and notes.

    Raises:
        InputError: for elements of an unknown kind, missing nodes, sets that do not exist, parts that an assembly
            places or repeats, and generated nodes, which this reader does not place.
    """
    import meshio

    model = _Model()
    _read(path, model, f"path = {str(path)!r}")
    order = {number: index for index, number in enumerate(model.nodes)}
    numbers = list(model.elements)
    kinds = np.array([model.elements[number][0] for number in numbers])
    cells, blocks = [], {}
    for kind in dict.fromkeys(kinds.tolist()):
        chosen = [number for number in numbers if model.elements[number][0] == kind]
        for number in chosen:
            for node in model.elements[number][1]:
                if node not in order:
                    raise InputError(f"path = {str(path)!r}: element {number} has node {node}, which is missing")
        cells.append((kind, np.array([[order[node] for node in model.elements[number][1]] for number in chosen])))
        blocks[kind] = {number: index for index, number in enumerate(chosen)}
    for name, members in model.node_sets.items():
        if missing := [node for node in members if node not in order]:
            raise InputError(f"path = {str(path)!r}: node set {name!r} has node {missing[0]}, which is missing")
    mesh = meshio.Mesh(
        np.array([[*each, 0.0, 0.0][:3] for each in model.nodes.values()]).reshape(-1, 3),
        cells,
        point_sets={name: np.array([order[node] for node in members]) for name, members in model.node_sets.items()},
        cell_sets={
            name: [np.array([at[n] for n in members if n in at], np.int64) for at in blocks.values()]
            for name, members in model.element_sets.items()
        },
    )
    return mesh, model.notes


def _read(path: Path, model: _Model, where: str) -> None:
    for keyword, options, here in _blocks(path):
        rows = here
        name = options.get("NSET") or options.get("ELSET")
        if options.get("SYSTEM", "R").upper() != "R":
            raise InputError(f"{where}: *{keyword}, SYSTEM={options['SYSTEM']}: expected rectangular coordinates, R")
        if "INPUT" in options and keyword != "INCLUDE":
            rows = [*here, *_data(_lines(_other_file(path, keyword, options, where)))]
        if keyword == "NODE":
            nodes = {int(row[0]): [float(value or 0.0) for value in row[1:4]] for row in rows}
            if again := [node for node in nodes if node in model.nodes]:
                raise InputError(f"{where}: node {again[0]} occurs twice: expected parts with numbers of their own")
            model.nodes.update(nodes)
            if name:
                model.node_sets.setdefault(name, []).extend(nodes)
        elif keyword == "ELEMENT":
            _add_elements(model, options, [int(word) for row in rows for word in row if word], where)
        elif keyword in ("NSET", "ELSET"):
            sets = model.node_sets if keyword == "NSET" else model.element_sets
            if name is None:
                raise InputError(f"{where}: *{keyword}: expected {keyword}=name")
            sets.setdefault(name, []).extend(_members(sets, model, options, rows, where, name))
        elif keyword == "INCLUDE":
            _read(_other_file(path, keyword, options, where), model, where)
        elif keyword in ("NGEN", "NFILL", "NCOPY", "ELGEN", "ELCOPY", "SYSTEM", "NMAP"):
            raise InputError(f"{where}: *{keyword} is not read: expected all nodes and elements in the file")
        elif keyword == "INSTANCE":
            if any(any(word and float(word) != 0.0 for word in row) for row in rows):
                raise InputError(f"{where}: *INSTANCE moves a part: expected nodes where they are in the assembly")
            if (part := options.get("PART", "").upper()) in model.placed:
                raise InputError(f"{where}: *INSTANCE repeats the part {options['PART']!r}: expected one of each part")
            model.placed.add(part)


def _other_file(path: Path, keyword: str, options: dict[str, str], where: str) -> Path:
    """The file that a keyword of another one reads."""
    name = options.get("INPUT", "")
    if not (found := path.parent / name).is_file():
        raise InputError(f"{where}: *{keyword}, INPUT={name}: {str(found)!r} does not exist: expected a file")
    return found


def _add_elements(model: _Model, options: dict[str, str], words: list[int], where: str) -> None:
    kind = options.get("TYPE", "").upper()
    names, size = _kind(kind)
    if size not in names:
        raise InputError(f"{where}: *ELEMENT, TYPE={kind}: expected shells, membranes or plane elements")
    if len(words) % (size + 1):
        raise InputError(f"{where}: *ELEMENT, TYPE={kind}: {len(words)} numbers: expected {size + 1} for each element")
    rows = np.array(words, np.int64).reshape(-1, size + 1).tolist()
    for begins, what in NOT_SHEETS.items():
        if kind.startswith(begins):
            model.notes.append(f"{len(rows)} {what} ({kind}) became part of the sheet; part= reads one element set")
    if again := [row[0] for row in rows if row[0] in model.elements]:
        raise InputError(f"{where}: element {again[0]} occurs twice: expected elements with numbers of their own")
    model.elements.update({row[0]: (names[size], row[1:]) for row in rows})
    if "ELSET" in options:
        model.element_sets.setdefault(options["ELSET"], []).extend(row[0] for row in rows)


def _kind(kind: str) -> tuple[dict[int, str], int]:
    """Kinds by number of nodes, and the number of an element by its name: 4 of S4R, 6 of STRI65, 2 of B31 and T3D2."""
    if beam := BEAM.match(kind):
        return LINES, BEAM_NODES[beam[1]]
    if line := LINE.match(kind):
        return LINES, int(line[1]) + kind.startswith("SAX")
    surface = SURFACE.match(kind)
    return SURFACES, int(surface[1]) if surface else 0


def _members(
    sets: dict[str, list[int]], model: _Model, options: dict[str, str], rows: list[list[str]], where: str, name: str
) -> list[int]:
    """Numbers of a set, of which data lines list numbers, ranges (GENERATE) or names of sets."""
    found: list[int] = []
    for row in rows:
        words = [word for word in row if word]
        if "GENERATE" in options:
            begin, end, step = (int(word) for word in [*words, "1"][:3])
            if abs((end - begin) // step) >= MOST_MEMBERS:
                raise InputError(
                    f"{where}: set {name!r} from {begin} to {end}: expected at most {MOST_MEMBERS} numbers"
                )
            found += range(begin, end + 1, step)
            continue
        for word in words:
            # Of an assembly, a number may follow the name of its instance.
            plain = word.rpartition(".")[2]
            if plain.lstrip("-").isdigit():
                found.append(int(plain))
            elif plain.upper() in {each.upper() for each in sets}:
                found += next(members for each, members in sets.items() if each.upper() == plain.upper())
            else:
                raise InputError(f"{where}: set {name!r} contains {word!r}: expected a number or a set before it")
    if "ELSET" in options and "NSET" in options:
        for number in model.element_sets.get(options["ELSET"], []):
            found += model.elements[number][1]
    return found


def _blocks(path: Path) -> Iterator[tuple[str, dict[str, str], list[list[str]]]]:
    """Keyword, options and data rows of each block; comments begin with two stars."""
    keyword, options, rows = "", dict[str, str](), list[list[str]]()
    lines = _lines(path)
    index = 0
    while index < len(lines):
        line = lines[index]
        index += 1
        if not line.startswith("*"):
            rows += _data([line])
            continue
        # A comma at the end continues the options.
        while line.endswith(",") and index < len(lines):
            line, index = line + lines[index], index + 1
        if keyword:
            yield keyword, options, rows
        words = [word.strip() for word in line[1:].split(",")]
        keyword, rows = words[0].upper(), []
        pairs = [word.partition("=") for word in words[1:] if word]
        options = {key.strip().upper(): value.strip().strip('"') for key, _, value in pairs}
    if keyword:
        yield keyword, options, rows


def _lines(path: Path) -> list[str]:
    lines = [line.strip() for line in path.read_text(encoding="utf-8", errors="replace").splitlines()]
    return [line for line in lines if line and not line.startswith("**")]


def _data(lines: list[str]) -> list[list[str]]:
    return [[word.strip() for word in line.split(",")] for line in lines]
