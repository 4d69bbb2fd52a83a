"""Faces of Wavefront .obj files."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import numpy as np

from ..device.checks import InputError, show
from .usd_mesh import Faces


def read_wavefront(path: Path) -> Faces:
    """Read vertices, polygons and the groups (`g`) and objects (`o`) of the polygons; normals and textures are ignored.

    Corners count from 1, or backwards from the last vertex so far if negative. Raises InputError with the line.
    """
    points: list[list[float]] = []
    faces: list[list[int]] = []
    current: dict[str, list[str]] = {"o": [], "g": []}
    groups: dict[str, list[int]] = {}
    lines = 0
    for number, words in _statements(path):
        try:
            if words[0] == "v":
                points.append([float(word) for word in words[1:4]])
            elif words[0] == "f":
                corners = [int(word.split("/")[0]) for word in words[1:]]
                for name in dict.fromkeys([*current["o"], *current["g"]]):
                    groups.setdefault(name, []).append(len(faces))
                faces.append([corner - 1 if corner > 0 else len(points) + corner for corner in corners])
            elif words[0] == "l":
                lines += 1
        except ValueError:
            where = f"path = {str(path)!r}: the file cannot be read: line {number}"
            raise InputError(f"{where}: {show(' '.join(words))}: expected numbers") from None
        if words[0] == "o":
            current["o"] = [" ".join(words[1:])] if words[1:] else []
        elif words[0] == "g":
            current["g"] = [name for name in words[1:] if name not in ("default", "off")]
    return Faces(
        points=np.array(points, np.float64).reshape(-1, 3),
        counts=np.array([len(face) for face in faces], np.int64),
        corners=np.array([corner for face in faces for corner in face], np.int64),
        meters=None,
        groups={name: np.array(members) for name, members in groups.items() if len(members) < len(faces)},
        notes=[f"{lines} line elements were left out"] if lines else [],
    )


def _statements(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Line number and words of each statement; a backslash continues it on the next line."""
    held: list[str] = []
    with open(path, encoding="utf-8-sig", errors="replace") as file:
        for number, line in enumerate(file, start=1):
            text = line.partition("#")[0].rstrip()
            held += text.removesuffix("\\").split()
            if not text.endswith("\\"):
                if held:
                    yield number, held
                held = []
