"""Test data: CSV files with units in the header, curves, and displacement fields."""

from __future__ import annotations

import codecs
import csv
import math
import re
import unicodedata
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from ..device.checks import InputError, show

HEADER = re.compile(r"^\s*([^\[\]()]+?)\s*[\[(]\s*([^\[\]()]*)\s*[\])]\s*$")
# A number with separators; one whose commas, points or spaces may separate thousands.
NUMERIC = re.compile(r"[-+]?[\d.,]*\d[\d.,]*([eE][-+]?\d+)?")
GROUPED = {mark: re.compile(rf"[-+]?[1-9]\d{{0,2}}({re.escape(mark)}\d{{3}})+") for mark in ",."}
SPACED = re.compile(r"[-+]?[1-9]\d{0,2}([\s'\u2019]\d{3})+([.,]\d*)?")
# Stretches and strains beyond which numbers were likely meant as something else: no rubber goes there.
LEAST_STRETCH, MOST_STRETCH = 0.2, 20.0
# Losses of the residuals of a fit.
LOSSES = ("linear", "soft_l1")
EMPTY = ("", "nan", "na", "n/a", "-", "none")
# Columns of a field: places in the undeformed sheet, and displacements.
PLACES, DISPLACEMENTS = ("x", "y", "z"), ("u", "v", "w")
# Factor to SI and dimension of each unit.
UNITS: dict[str, tuple[float, str]] = {
    "1": (1.0, "ratio"), "-": (1.0, "ratio"), "%": (0.01, "ratio"),
    "mm/mm": (1.0, "ratio"), "m/m": (1.0, "ratio"), "in/in": (1.0, "ratio"),
    "m": (1.0, "length"), "mm": (1e-3, "length"), "cm": (1e-2, "length"), "um": (1e-6, "length"),
    "µm": (1e-6, "length"), "in": (0.0254, "length"),
    "Pa": (1.0, "pressure"), "kPa": (1e3, "pressure"), "MPa": (1e6, "pressure"), "GPa": (1e9, "pressure"),
    "bar": (1e5, "pressure"), "mbar": (1e2, "pressure"), "psi": (6894.757293168, "pressure"),
    "mmHg": (133.322387415, "pressure"), "kg/cm^2": (98066.5, "pressure"), "N/mm^2": (1e6, "pressure"),
    "kgf/cm^2": (98066.5, "pressure"), "atm": (101325.0, "pressure"),
    "mmH2O": (9.80665, "pressure"), "cmH2O": (98.0665, "pressure"), "inH2O": (249.08891, "pressure"),
    "N": (1.0, "force"), "mN": (1e-3, "force"), "kN": (1e3, "force"), "gf": (9.80665e-3, "force"),
    "kgf": (9.80665, "force"), "lbf": (4.4482216152605, "force"),
    "s": (1.0, "time"), "ms": (1e-3, "time"), "min": (60.0, "time"), "h": (3600.0, "time"),
    "m^3": (1.0, "volume"), "l": (1e-3, "volume"), "ml": (1e-6, "volume"), "mm^3": (1e-9, "volume"),
    "J": (1.0, "energy"), "mJ": (1e-3, "energy"), "J/m^2": (1.0, "energy per area"),
    "kJ/m^2": (1e3, "energy per area"), "N/mm": (1e3, "energy per area"),
    "m/s": (1.0, "velocity"), "mm/s": (1e-3, "velocity"), "mm/min": (1e-3 / 60.0, "velocity"),
    "Hz": (1.0, "frequency"), "1/s": (1.0, "rate"), "s^-1": (1.0, "rate"), "%/s": (0.01, "rate"),
    "1/min": (1.0 / 60.0, "rate"), "%/min": (0.01 / 60.0, "rate"), "degrees": (1.0, "angle"), "deg": (1.0, "angle"),
}  # fmt: skip
# Dimensions that the names of scene arguments imply; other names are not checked.
DIMENSIONS = {
    "pressure": "pressure", "stretch": "ratio", "prestretch": "ratio", "strain": "ratio", "time": "time",
    "travel": "length", "extension": "length", "thickness": "length", "depth": "length", "force": "force",
    "mu": "pressure", "bulk": "pressure", "load_factor": "ratio",
}  # fmt: skip


def factor_and_dimension(column: str, unit: str, file: str) -> tuple[float, str]:
    """Conversion factor to SI, and dimension. Raises InputError if the unit is unknown."""
    # Both letters mu, and raised digits.
    known = re.sub(r"(?<=[a-z])(\d)", r"^\1", unicodedata.normalize("NFKC", unit).replace("\u03bc", "u"))
    if known not in UNITS:
        near = [name for name in UNITS if name.lower() == known.lower()]
        hint = f" (did you mean {' or '.join(near)}?)" if near else ""
        raise InputError(
            f"{file}: column {column!r}: unit [{unit}] is not known: expected one of {', '.join(UNITS)}{hint}"
        )
    return UNITS[known]


def require_stretches(name: str, stretch: np.ndarray) -> None:
    """Check that numbers can be stretches: 1 is undeformed. Raises InputError for strains and percents."""
    if np.min(stretch) < LEAST_STRETCH:
        raise InputError(
            f"{name}: expected positive stretches, got {np.min(stretch):g}; 1 is undeformed: add 1 to strains, or call "
            "the column of a uniform test 'uniaxial strain' and the like"
        )
    if np.max(stretch) > MOST_STRETCH:
        raise InputError(
            f"{name}: expected stretches, got {np.max(stretch):g}; 1 is undeformed: write the unit [%] for percents"
        )


def dimension_of(unit: str) -> str | None:
    """Dimension of the SI unit of a measure; None for an unknown unit."""
    return UNITS[unit][1] if unit in UNITS else None


@dataclass(frozen=True, eq=False)
class Curve:
    """Measured values against a control.

    Attributes:
        control: Argument of the scene, such as "pressure" or "stretch"; or "time", or "load_factor".
        at: Its values in SI units, shape (n,).
        measure: Measure of the scene.
        values: Measured values in SI units, shape (n,).
        sigma: Standard deviation of the noise in SI units; None to scale every test by its largest value.
        name: Name of the test, for reports.
        rows: Line numbers in its file, shape (n,), or None.
        units: SI units of control and measure, for labels; "" if unknown.
    """

    control: str
    at: np.ndarray
    measure: str
    values: np.ndarray
    sigma: float | None = None
    name: str = ""
    rows: np.ndarray | None = None
    units: tuple[str, str] = ("", "")

    def __post_init__(self) -> None:
        """Check the shapes."""
        at, values = np.asarray(self.at, dtype=float), np.asarray(self.values, dtype=float)
        object.__setattr__(self, "at", at)
        object.__setattr__(self, "values", values)
        if at.ndim != 1 or at.shape != values.shape or len(at) == 0:
            raise InputError(
                f"Curve: at has shape {at.shape}, values {values.shape}: expected equal lengths, at least 1"
            )
        if not (np.isfinite(at).all() and np.isfinite(values).all()):
            raise InputError("Curve: expected finite numbers; leave gaps out")
        if self.sigma is not None and not self.sigma > 0.0:
            raise InputError(f"Curve.sigma = {self.sigma!r}: expected a number greater than 0")

    @property
    def scale(self) -> float:
        """Divisor of the residuals."""
        return self.sigma or float(np.abs(self.values).max()) or 1.0


def si_unit(dimension: str | None) -> str:
    """SI unit of a dimension, "1" for a ratio; empty for an unknown dimension."""
    return next((name for name, (factor, of) in UNITS.items() if of == dimension and factor == 1.0), "")


@dataclass(frozen=True, eq=False)
class FieldData:
    """Displacements at positions on the undeformed sheet, as from digital image correlation.

    Attributes:
        places: Positions [m], shape (M, 2) or (M, 3).
        displacements: Displacements [m], shape (M, 3); NaN for components that were not measured.
        control: As for Curve; "" if nothing is varied.
        at: Value of the control.
        sigma: As for Curve.
        name: As for Curve.
        rows: As for Curve.
    """

    places: np.ndarray
    displacements: np.ndarray
    control: str = ""
    at: float = 1.0
    sigma: float | None = None
    name: str = ""
    rows: np.ndarray | None = None

    def __post_init__(self) -> None:
        """Check the shapes. Raises InputError if the shapes differ, or no displacement was measured."""
        shape = (len(self.places), 3)
        if self.displacements.shape != shape:
            raise InputError(f"FieldData: displacements have shape {self.displacements.shape}: expected {shape}")
        if not np.isfinite(self.displacements).any():
            raise InputError("FieldData: no displacement is finite: expected at least one measured value")

    @property
    def scale(self) -> float:
        """Divisor of the residuals."""
        return self.sigma or float(np.nanmax(np.abs(self.displacements))) or 1.0


Test = Curve | FieldData


@dataclass(frozen=True, eq=False)
class Table:
    """A file of numbers in SI units.

    Attributes:
        columns: Values by name, NaN where a cell is empty, each of shape (n,).
        dimensions: Dimension by name.
        units: Unit in the file by name.
        rows: Line number in the file of each row, shape (n,).
        notes: Notes on skipped rows, one line each.
    """

    path: Path
    columns: dict[str, np.ndarray]
    dimensions: dict[str, str]
    units: dict[str, str]
    rows: np.ndarray
    notes: list[str] = field(default_factory=list)

    def without_gaps(self, names: Sequence[str]) -> tuple[dict[str, np.ndarray], np.ndarray]:
        """Columns and line numbers of the rows without gaps in the named columns; other rows are noted."""
        whole = np.ones(len(self.rows), bool)
        for name in names:
            missing = np.isnan(self.columns[name])
            for row in self.rows[missing & whole]:
                self.notes.append(f"{self.path.name}, line {row}: {name} is missing: the row is left out")
            whole &= ~missing
        return {name: self.columns[name][whole] for name in names}, self.rows[whole]


def read_table(path: str | Path) -> Table:
    """Read a CSV file whose header names each column and its unit, as in "pressure [kPa], deflection [mm]".

    Empty cells are gaps. Lines that begin with # are skipped. Columns are separated by commas, semicolons or tabs. The
    decimal separator is that of the file, found from all of its cells. The text is UTF-8, UTF-16, GB18030 or
    Latin-1. Units may be in a second row, below the names.

    Raises:
        InputError: if the file cannot be read, a column has no unit or an unknown one, a cell is not a number, or
            numbers such as 1,000 may have thousands or decimals.
    """
    path = Path(path)
    text, notes = _text_of(path)
    lines = text.splitlines()
    kept = [
        (number, line) for number, line in enumerate(lines, 1) if line.strip() and not line.lstrip().startswith("#")
    ]
    if len(kept) < 2:
        raise InputError(f"file = {str(path)!r}: expected a header and rows of numbers")
    first = kept[0][1]
    separator = max(";\t,", key=first.count)
    cells = [next(csv.reader([line], delimiter=separator)) for _, line in kept]
    header, above = _joined_header(path, cells[0], cells[1], kept[1][0])
    names, units, factors, dimensions = _header(path, header)
    cells, rows = cells[above:], np.array([number for number, _ in kept[above:]])
    for row, number in zip(cells, rows, strict=True):
        if len(row) != len(names):
            commas = "; with decimal commas, separate columns by semicolons" if len(row) == 2 * len(names) else ""
            raise InputError(
                f"{path.name}, line {number}: {len(row)} cells: expected {len(names)}, one per column{commas}"
            )
    plain = [[plain_number(text) for text in row] for row in cells]
    decimal = decimal_of(path.name, plain)
    values = np.full((len(cells), len(names)), np.nan)
    for k, (row, number) in enumerate(zip(plain, rows, strict=True)):
        for c, text in enumerate(row):
            values[k, c] = factors[c] * _number(path, int(number), names[c], text, decimal)
    columns = {name: values[:, c] for c, name in enumerate(names)}
    by_name = [dict(zip(names, each, strict=True)) for each in (dimensions, units)]
    return Table(path, columns, by_name[0], by_name[1], rows, notes)


def _text_of(path: Path) -> tuple[str, list[str]]:
    """The text of a file, and a note if it is not UTF-8."""
    try:
        content = path.read_bytes()
    except OSError as error:
        raise InputError(f"file = {str(path)!r}: cannot be read ({type(error).__name__})") from None
    try:
        if content.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
            return content.decode("utf-16"), []
        return content.decode("utf-8-sig"), []
    except UnicodeDecodeError:
        pass
    if (chinese := _chinese(content)) is not None:
        return chinese, [f"{path.name}: read as GB18030, as it is not UTF-8"]
    try:
        return content.decode("cp1252"), [f"{path.name}: read as Latin-1, as it is not UTF-8"]
    except UnicodeDecodeError:
        raise InputError(f"file = {str(path)!r}: expected text in UTF-8, UTF-16, GB18030 or Latin-1") from None


def _chinese(content: bytes) -> str | None:
    """The text if all bytes beyond ASCII are pairs of GB18030, symbols or common characters; accents come singly."""
    runs = re.findall(rb"[\x80-\xff]+", content)
    pairs = [run[k : k + 2] for run in runs for k in range(0, len(run), 2)]
    if not all(len(pair) == 2 and (0xA1 <= pair[0] <= 0xA9 or 0xB0 <= pair[0] <= 0xD7) for pair in pairs):
        return None
    try:
        text = content.decode("gb18030")
    except UnicodeDecodeError:
        return None
    return text if any(0xB0 <= pair[0] for pair in pairs) else None


def plain_number(text: str) -> str:
    """The text of a number with an ASCII minus, and without spaces or apostrophes between thousands."""
    text = text.strip().replace("\u2212", "-")
    return re.sub(r"[\s'\u2019]", "", text) if SPACED.fullmatch(text) else text


def decimal_of(file: str, cells: Sequence[Sequence[str]]) -> str:
    """The decimal separator of a file, a point or a comma; the other one separates thousands.

    Raises:
        InputError: if the cells, (rows, columns), do not tell, or contradict each other.
    """
    columns = list(zip(*cells, strict=True))
    texts = [text for column in columns for text in column if NUMERIC.fullmatch(text)]
    decimals = {mark for text in texts for mark in ",." if mark in text and not GROUPED[mark].fullmatch(text)}
    for text in texts:
        if {",", "."} <= set(text):
            # The last one is the decimal separator, and the first one must be that of thousands.
            last, first = sorted(",.", key=text.rfind, reverse=True)
            if text.count(last) > 1 or not GROUPED[first].fullmatch(text[: text.rfind(last)]):
                raise InputError(f"{file}: {text!r}: expected a number, such as 1234.5")
            decimals.discard(first)
            decimals.add(last)
    used = {mark for text in texts for mark in ",." if mark in text}
    if len(decimals) > 1:
        raise InputError(
            f"{file}: points and commas are both decimal separators: expected one of them in the whole file"
        )
    if decimals or not used:
        return next(iter(decimals), ".")
    # Each could separate thousands: 1,000 or 1.000. Numbers with three decimals all have them.
    always = all(
        len({bool(GROUPED["."].fullmatch(text)) for text in column if NUMERIC.fullmatch(text)}) < 2
        for column in columns
    )
    if used == {"."} and always:
        return "."
    example = next(text for text in texts if "," in text or "." in text)
    raise InputError(
        f"{file}: {example!r} may have thousands or decimals: expected numbers without separators of thousands, and "
        f"with another number of decimals than three"
    )


def _joined_header(path: Path, first: list[str], second: list[str], line: int) -> tuple[list[str], int]:
    """The header, and its number of rows: two where the second one has the units, such as "mm" or "(mm)", in its cells.

    Raises InputError for any other second row of words.
    """
    words = [text.strip().strip("[](){}\uff08\uff09").strip() for text in second]
    if any(NUMERIC.fullmatch(plain_number(text)) or text.lower() in EMPTY[1:4] for text in words) or not any(words):
        return first, 1
    if len(second) == len(first) and not any(HEADER.match(_half_width(cell)) for cell in first):
        return [f"{name} [{unit or '1'}]" for name, unit in zip(first, words, strict=True)], 2
    raise InputError(
        f"{path.name}, line {line}: {show(', '.join(second))}: expected numbers below the header; begin other lines "
        "with #"
    )


def _half_width(cell: str) -> str:
    """A cell with ASCII brackets in place of those of Chinese text."""
    return cell.translate(str.maketrans("\uff08\uff09\uff3b\uff3d", "()[]"))


def _header(path: Path, cells: Sequence[str]) -> tuple[list[str], list[str], list[float], list[str]]:
    names, units, factors, dimensions = [], [], [], []
    for cell in cells:
        match = HEADER.match(_half_width(cell))
        if match is None:
            raise InputError(
                f"{path.name}: column {cell.strip()!r}: expected a name and a unit, such as 'pressure [kPa]', or "
                "units in the row below"
            )
        name = re.sub(r"\W+", "_", match.group(1).strip()).lower()
        if name in names:
            raise InputError(f"{path.name}: column {name!r} appears twice: expected different names")
        unit = match.group(2).strip() or "1"
        factor, dimension = factor_and_dimension(name, unit, path.name)
        names.append(name)
        units.append(unit)
        factors.append(factor)
        dimensions.append(dimension)
    return names, units, factors, dimensions


def _number(path: Path, line: int, name: str, text: str, decimal: str) -> float:
    if text.lower() in EMPTY:
        return math.nan
    try:
        value = float(text.replace("." if decimal == "," else ",", "").replace(decimal, "."))
    except ValueError:
        value = math.inf
    if not math.isfinite(value):
        raise InputError(
            f"{path.name}, line {line}: {name} = {text!r}: expected a number that is finite, or an empty cell"
        )
    return value
