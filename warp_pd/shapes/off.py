"""Faces of .off files."""

from __future__ import annotations

import itertools
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np

from ..device.checks import InputError, show
from .usd_mesh import Faces

# Before OFF: texture coordinates, colours or normals of the vertices, which follow their coordinates.
HEADER = re.compile(r"(ST)?C?N?OFF")


def read_off(path: Path) -> Faces:
    """Read vertices and polygons of an .off file of text; colours, normals and texture coordinates are ignored.

    See http://www.geomview.org/docs/html/OFF.html; a vertex or a face is a line. Raises InputError with the line.
    """
    where = f"path = {str(path)!r}: the file cannot be read"
    lines = _lines(path)
    number, words = next(lines, (1, []))
    if words and not words[0].isdigit():
        if not HEADER.fullmatch(words[0]) or "BINARY" in words:
            raise InputError(f"{where}: line {number}: {show(' '.join(words))}: expected OFF, and a file of text in 3D")
        number, words = (number, words[1:]) if words[1:] else next(lines, (number, []))
    if len(words) < 2 or not all(word.isdigit() for word in words):
        raise InputError(f"{where}: line {number}: {show(' '.join(words))}: expected the numbers of vertices and faces")
    counts = int(words[0]), int(words[1])
    points = _read(where, lines, counts[0], _vertex, "three coordinates")
    read = _read(where, lines, counts[1], _face, "the number of its corners, and the corners")
    faces = [face for face in read if len(face) > 2]
    loose = len(read) - len(faces)
    found = len(points), len(read)
    if found != counts or next(lines, None) is not None:
        more = f"{found[0]} and {found[1]}" if found != counts else "more lines"
        raise InputError(f"{where}: {counts[0]} vertices and {counts[1]} faces, by its header, but has {more}")
    return Faces(
        points=np.array(points, np.float64).reshape(-1, 3),
        counts=np.array([len(face) for face in faces], np.int64),
        corners=np.array([corner for face in faces for corner in face], np.int64),
        meters=None,
        notes=[f"{loose} faces of fewer than three corners were left out"] if loose else [],
    )


def _read(
    where: str,
    lines: Iterator[tuple[int, list[str]]],
    count: int,
    convert: Callable[[list[str]], list[Any]],
    wanted: str,
) -> list[list[Any]]:
    """The next lines, at most `count`. Raises InputError if `convert` raises ValueError."""
    found = []
    for number, words in itertools.islice(lines, count):
        try:
            found.append(convert(words))
        except ValueError:
            raise InputError(f"{where}: line {number}: {show(' '.join(words))}: expected {wanted}") from None
    return found


def _vertex(words: list[str]) -> list[float]:
    x, y, z = words[:3]
    return [float(x), float(y), float(z)]


def _face(words: list[str]) -> list[int]:
    corners = [int(word) for word in words[1 : 1 + int(words[0])]]
    if not 0 < len(corners) == int(words[0]):
        raise ValueError
    return corners


def _lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and words of each line that has any, without comments."""
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            if words := line.partition("#")[0].split():
                yield number, words
