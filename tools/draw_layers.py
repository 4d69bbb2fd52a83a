"""Draw the layers of the package, and which package imports which, as docs/layers.svg.

    python tools/draw_layers.py                 write the picture
    python tools/draw_layers.py --check         exit code 1 if it is not what the imports say now

The layers are those of the contract in pyproject.toml that `tools/start.sh test` checks. An arrow stands for an
import; one that follows from others (A imports B, B imports C, so A reaches C) is left out. Scenes are left out: they
are users, and import anything.
"""

from __future__ import annotations

import argparse
import ast
import sys
import tomllib
from pathlib import Path

ROOT = Path(__file__).resolve().parents[1]
PICTURE = ROOT / "docs" / "layers.svg"
LEFT_OUT = {"scenes"}
ROW, COLUMN, HEIGHT, SIZE = 62, 170, 34, 14


def layers() -> list[list[str]]:
    """Names below warp_pd, the highest layer first."""
    contracts = tomllib.loads((ROOT / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    contract = next(c for c in contracts if c["type"] == "layers")
    return [[name.strip().removeprefix("warp_pd.") for name in row.split("|")] for row in contract["layers"]]


def imports(names: list[str]) -> dict[str, set[str]]:
    """Which of the names each of them imports, wherever in its files."""
    found: dict[str, set[str]] = {}
    for name in names:
        found[name] = set()
        for path in _files(name):
            for imported in _imported(path, name):
                target = next((n for n in names if imported == n or imported.startswith(n + ".")), None)
                if target not in (None, name):
                    found[name].add(target)
    return found


def _files(name: str) -> list[Path]:
    for folder in (ROOT / "warp_pd" / name, ROOT / name):
        if folder.is_dir():
            return sorted(folder.rglob("*.py"))
    return [ROOT / "warp_pd" / f"{name}.py"]


def _imported(path: Path, name: str) -> list[str]:
    """Modules of the package that a file imports, without the leading "warp_pd."."""
    inside = path.relative_to(ROOT).parts[:-1]
    inside = inside[1:] if inside[0] == "warp_pd" else inside
    found = []
    for node in ast.walk(ast.parse(path.read_text())):
        if not isinstance(node, ast.ImportFrom):
            continue
        named = (node.module or "").split(".")
        if node.level:
            base = [*inside[: len(inside) - node.level + 1], *named]
        elif named[0] == "warp_pd":
            base = named[1:]
        else:
            continue
        module = ".".join(part for part in base if part)
        # `from warp_pd import Simulation` takes what the package offers, which `run` stands for.
        found += [module] if module else ["run" if alias.name[0].isupper() else alias.name for alias in node.names]
    return found


def reduced(found: dict[str, set[str]]) -> list[tuple[str, str]]:
    """The imports without those that follow from others."""

    def reach(name: str) -> set[str]:
        return set().union(*({target} | reach(target) for target in found[name]), set())

    return [
        (name, target)
        for name, targets in found.items()
        for target in sorted(targets)
        if not any(target in reach(other) for other in targets - {target})
    ]


def picture() -> str:
    """The picture as SVG."""
    rows = [row for layer in layers() if (row := [name for name in layer if name not in LEFT_OUT])]
    widest = max(len(row) for row in rows)
    width = COLUMN * (widest + 2)
    place = {
        name: (width / 2 + COLUMN * 1.3 * (k - (len(row) - 1) / 2) + _shift(depth, len(row)), 30 + ROW * depth)
        for depth, row in enumerate(rows)
        for k, name in enumerate(row)
    }
    lines = [
        f'<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 {width} {ROW * len(rows)}" font-family="sans-serif" '
        f'font-size="{SIZE}" text-anchor="middle">',
        '<defs><marker id="head" viewBox="0 0 8 8" refX="8" refY="4" markerWidth="7" markerHeight="7" orient="auto">'
        '<path d="M0 0L8 4L0 8z" fill="#789"/></marker></defs>',
        f'<rect width="{width}" height="{ROW * len(rows)}" fill="white"/>',
    ]
    for name, target in reduced(imports([name for row in rows for name in row])):
        (x0, y0), (x1, y1) = place[name], place[target]
        top, bottom = y0 + HEIGHT / 2, y1 - HEIGHT / 2
        lines.append(
            f'<path d="M{x0:.0f} {top:.0f}C{x0:.0f} {top + 24:.0f} {x1:.0f} {bottom - 24:.0f} {x1:.0f} {bottom:.0f}" '
            f'fill="none" stroke="#789" stroke-width="1.3" marker-end="url(#head)"/>'
        )
    for name, (x, y) in place.items():
        wide = 20 + 8.2 * len(name)
        lines.append(
            f'<rect x="{x - wide / 2:.0f}" y="{y - HEIGHT / 2:.0f}" width="{wide:.0f}" height="{HEIGHT}" rx="6" '
            f'fill="#e6f2f1" stroke="#00796b"/><text x="{x:.0f}" y="{y + SIZE / 3:.0f}">{name}</text>'
        )
    return "\n".join([*lines, "</svg>", ""])


def _shift(depth: int, members: int) -> float:
    """Layers of one box step aside in turn, so that arrows between layers further apart pass them."""
    return (COLUMN * 0.45 if depth % 2 else -COLUMN * 0.45) if members == 1 else 0.0


def main() -> None:
    """Write or check the picture."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--check", action="store_true", help="write nothing")
    if not parser.parse_args().check:
        PICTURE.write_text(picture())
    elif not PICTURE.is_file() or PICTURE.read_text() != picture():
        sys.exit(f"{PICTURE.relative_to(ROOT)} is not what the imports say: run python tools/draw_layers.py")


if __name__ == "__main__":
    main()
