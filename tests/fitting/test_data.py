"""Files of tests: units, gaps, and what is wrong in one line."""

import fitting_cases as cases
import numpy as np
import pytest
from helpers import refused

from warp_pd import MooneyRivlin
from warp_pd.fitting import Curve, FieldData, UniformTests, read_table, read_tests
from warp_pd.fitting.data import UNITS


def written(tmp_path, text):
    path = tmp_path / "data.csv"
    path.write_text(text, encoding="utf-8")
    return path


def test_units_are_those_of_the_header(tmp_path):
    table = read_table(written(tmp_path, "# made up\nPressure [kPa], top height (mm)\n1.5,2\n\n3,4\n"))
    assert table.columns["pressure"].tolist() == [1500.0, 3000.0]
    assert table.columns["top_height"] == pytest.approx([2e-3, 4e-3])
    assert table.rows.tolist() == [3, 5]
    comma = read_table(written(tmp_path, "time [min];force [N]\n1,5;2,25\n"))
    assert comma.columns["time"].tolist() == [90.0]
    assert comma.columns["force"].tolist() == [2.25]


@pytest.mark.parametrize(("rows", "pressure", "height"), [
    ("500;10.1\n1,000;14.2\n1,500;17.0", [500, 1000, 1500], [10.1, 14.2, 17.0]),
    ("500;10,1\n1.000;14,2\n1.500;17,0", [500, 1000, 1500], [10.1, 14.2, 17.0]),
    ("0,500;10,125\n1,000;14,250", [0.5, 1.0], [10.125, 14.25]),
    ("1.000;10.125\n2.000;14.250", [1.0, 2.0], [10.125, 14.25]),
    ("1.234,5;1\n12.345,678;2", [1234.5, 12345.678], [1, 2]),
    ("1,234.5;1\n12,345.678;2", [1234.5, 12345.678], [1, 2]),
    ("1 000;10,1\n1'500;\u22122,5", [1000, 1500], [10.1, -2.5]),
    ("1,5e3;1", [1500], [1]),
])  # fmt: skip
def test_separators_are_those_of_the_file(tmp_path, rows, pressure, height):
    columns = read_table(written(tmp_path, f"pressure [Pa];height [mm]\n{rows}\n")).columns
    np.testing.assert_allclose(columns["pressure"], pressure)
    np.testing.assert_allclose(columns["height"], 1e-3 * np.array(height))
    quoted = rows.replace('"', "").replace(";", '";"').replace("\n", '"\n"').replace(";", ",")
    columns = read_table(written(tmp_path, f'pressure [Pa],height [mm]\n"{quoted}"\n')).columns
    np.testing.assert_allclose(columns["pressure"], pressure)


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "utf-16", "cp1252"])
def test_files_of_spreadsheets_are_read(tmp_path, encoding):
    """Also with either letter mu, and raised digits."""
    path = tmp_path / "data.csv"
    for unit in ("\u00b5m", "um") if encoding == "cp1252" else ("\u00b5m", "\u03bcm"):
        path.write_bytes(f"pressure [N/mm\u00b2],height [{unit}]\n2,3\n".encode(encoding))
        table = read_table(path)
        assert (table.columns["pressure"][0], table.columns["height"][0]) == pytest.approx((2e6, 3e-6), rel=1e-12)
        latin = encoding == "cp1252" and bool(path.read_bytes().count(0xB5) or path.read_bytes().count(0xB2))
        assert table.notes == (["data.csv: read as Latin-1, as it is not UTF-8"] if latin else [])


@pytest.mark.parametrize("units", ["kPa,mm", "(kPa),(mm)", "[kPa] , [mm]", '"(kPa)","(mm)"'])
def test_units_may_be_in_a_second_row(tmp_path, units):
    table = read_table(written(tmp_path, f"pressure,height\n{units}\n2,3\n4,5\n"))
    assert table.columns["pressure"].tolist() == [2e3, 4e3] and table.rows.tolist() == [3, 4]
    np.testing.assert_allclose(table.columns["height"], [3e-3, 5e-3])


@pytest.mark.parametrize(
    ("text", "encoding"),
    [
        ("\u538b\u529b pressure\uff08kPa\uff09,height(mm)\n2,3\n", "gb18030"),
        ("# \u8bd5\u9a8c\n\u538b\u529b pressure (kPa),height (mm)\n2,3\n", "gbk"),
        ("# Gr\u00f6\u00dfe, d\u00e9j\u00e0 vu\n\u538b pressure (kPa),height (mm)\n2,3\n", "utf-8"),
    ],
)
def test_chinese_spreadsheets_are_read(tmp_path, text, encoding):
    path = tmp_path / "data.csv"
    path.write_bytes(text.encode(encoding))
    table = read_table(path)
    first = next(name for name in table.columns if name.endswith("_pressure"))
    assert first.startswith("\u538b") and table.columns[first][0] == 2e3
    assert table.notes == ([] if encoding == "utf-8" else ["data.csv: read as GB18030, as it is not UTF-8"])


@pytest.mark.parametrize("word", ["Gr\u00f6\u00dfe", "d\u00e9form\u00e9e", "\u00c9paisseur", "\u00b0C", "na\u00efve"])
def test_accents_are_not_chinese(tmp_path, word):
    path = tmp_path / "data.csv"
    path.write_bytes(f"{word} [mm],b [N]\n2,3\n".encode("cp1252"))
    assert word.lower().strip("\u00b0") in next(iter(read_table(path).columns))


@pytest.mark.parametrize(("text", "said"), [
    ("stretch [1],force [N]\n0,0\n0.5,1\n", "expected positive stretches, got 0; 1 is undeformed: add 1 to strains"),
    ("stretch [1],force [N]\n110,1\n150,2\n", r"got 150; 1 is undeformed: write the unit \[%\] for percents"),
])  # fmt: skip
def test_strains_and_percents_are_no_stretches(tmp_path, text, said):
    with refused(match=said):
        read_tests(written(tmp_path, text), lambda stretch=1.3: cases.ogden_strip(stretch=stretch), None)
    with refused(match="expected positive stretches, got 0.05; 1 is undeformed: add 1 to strains"):
        curve = Curve("uniaxial", [0.05, 0.5], "stress", [1e5, 2e5])
        UniformTests(MooneyRivlin, [curve]).model(["c10"], np.ones(1), None, None)


def test_units_agree_with_each_other():
    """By definition: standard gravity, the inch, the pound and the density of mercury."""
    si = {unit: factor for unit, (factor, _) in UNITS.items()}
    gravity, pound, mercury = 9.80665, 0.45359237, 13595.1
    base = {"1", "-", "mm/mm", "m/m", "in/in", "m", "Pa", "N", "s", "m^3", "J", "J/m^2", "m/s", "Hz", "degrees", "deg"}
    base |= {"1/s", "s^-1"}
    assert {unit for unit, factor in si.items() if factor == 1.0} == base
    assert (si["mm"], si["cm"], si["um"], si["µm"], si["mJ"]) == (1e-3, 1e-2, 1e-6, 1e-6, 1e-3)
    assert si["mm/s"] == pytest.approx(si["mm"] / si["s"], rel=1e-12)
    assert si["kgf"] == pytest.approx(gravity, rel=1e-9) and si["gf"] == pytest.approx(1e-3 * gravity, rel=1e-9)
    assert si["lbf"] == pytest.approx(pound * gravity, rel=1e-9)
    assert si["psi"] == pytest.approx(si["lbf"] / si["in"] ** 2, rel=1e-9)
    assert si["mmHg"] == pytest.approx(mercury * gravity * si["mm"], rel=1e-6)
    assert si["kg/cm^2"] == si["kgf/cm^2"] == pytest.approx(si["kgf"] / si["cm"] ** 2, rel=1e-9)
    water = 1000.0 * gravity
    assert (si["mmH2O"], si["cmH2O"]) == pytest.approx((water * si["mm"], water * si["cm"]), rel=1e-9)
    assert si["inH2O"] == pytest.approx(water * si["in"], rel=1e-6) and si["atm"] == 101325.0
    assert (si["in"], si["cm"], si["bar"], si["%"], si["min"], si["h"]) == (0.0254, 0.01, 1e5, 0.01, 60.0, 3600.0)
    assert si["N/mm^2"] == si["MPa"] == 1e6 and si["N/mm"] == si["kJ/m^2"] == 1e3
    assert (si["l"], si["ml"], si["mm^3"]) == pytest.approx((1e-3, si["cm"] ** 3, si["mm"] ** 3), rel=1e-12)
    assert (si["%/s"], si["1/min"], si["%/min"]) == pytest.approx(
        (si["%"] / si["s"], 1.0 / si["min"], si["%"] / si["min"]), rel=1e-12
    )
    assert si["mm/min"] == pytest.approx(si["mm"] / si["min"], rel=1e-12)
    assert (si["kPa"], si["GPa"], si["mbar"], si["kN"], si["mN"], si["ms"]) == (1e3, 1e9, 1e2, 1e3, 1e-3, 1e-3)


@pytest.mark.parametrize("cell", ["inf", "-Infinity", "1e999"])
def test_a_cell_that_is_not_finite_is_refused(tmp_path, cell):
    with refused(f"data.csv, line 3: height = {cell!r}: expected a number that is finite, or an empty cell"):
        read_table(written(tmp_path, f"pressure [kPa],height [mm]\n1,2\n2,{cell}\n"))


def test_gaps_are_left_out_and_named(tmp_path):
    path = written(tmp_path, "pressure [kPa],height [mm]\n1,2\n2,\n,3\n4,nan\n5,6\n")
    (curve,), notes = read_tests(path, cases.blown, None)
    assert curve.at.tolist() == [1e3, 5e3]
    assert curve.values == pytest.approx([2e-3, 6e-3])
    assert curve.rows.tolist() == [2, 6]
    assert sorted(note.split(": the row")[0] for note in notes) == [
        "data.csv, line 3: height is missing",
        "data.csv, line 4: pressure is missing",
        "data.csv, line 5: height is missing",
    ]


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("pressure,height [mm]\n1,2\n", "column 'pressure': expected a name and a unit"),
        ("pressure [kPa],height [parsec]\n1,2\n", r"data.csv: column 'height': unit \[parsec\] is not known"),
        ("pressure [kPa],height [mm]\n1,two\n", "line 2: height = 'two': expected a number"),
        (
            "pressure [kPa],height [mm]\nraw,filtered\n1,2\n",
            "line 2: 'raw, filtered': expected numbers below the header",
        ),
        ("pressure,height\nkPa,parsec\n1,2\n", r"column 'height': unit \[parsec\] is not known"),
        ("pressure [kPa],height [mm]\n1,2,3\n", "line 2: 3 cells: expected 2"),
        ("pressure [kPa],height [mm]\n1,5,2,5\n", "4 cells: expected 2, one per column; with decimal commas, separate"),
        ("pressure [kPa];height [mm]\n1,000;2,000\n", "'1,000' may have thousands or decimals: expected numbers"),
        ("pressure [kPa];height [mm]\n500;1\n1.000;2\n", "'1.000' may have thousands or decimals"),
        ("pressure [kPa];height [mm]\n1,5;2.5\n", "points and commas are both decimal separators"),
        ("pressure [KPA],height [mm]\n1,2\n", r"unit \[KPA\] is not known: .*did you mean kPa"),
        ("pressure [mm],height [kPa]\n1,2\n", "column 'pressure' is a length: expected a pressure; the columns seem"),
        ("pressure [kPa],height [N]\n1,2\n", "column 'height' is a force: expected a length"),
        ("pressure [s],height [mm]\n1,2\n", "column 'pressure' is a time: expected a pressure"),
        ("depth [mm],height [mm]\n1,2\n", "expected one named as an argument of the scene"),
        (
            "pressure [kPa],top [mm]\n1,2\n",
            "column 'top': expected a measure of the scene: height, edge_height, pull; or name it",
        ),
        ("pressure [kPa],pressure [kPa]\n1,2\n", "column 'pressure' appears twice"),
        ("pressure [kPa],height [mm]\n", "expected a header and rows"),
        ("pressure [kPa],height [mm]\n1,\n", "expected rows with both pressure and height"),
        ("pressure [kPa],mu [kPa],height [mm]\n1,2,3\n", "columns pressure, mu are arguments of the scene"),
    ],
)
def test_wrong_files_are_refused_in_a_line(tmp_path, text, said):
    with refused(match=said):
        read_tests(written(tmp_path, text), cases.blown, None)


def test_a_missing_file_is_refused(tmp_path):
    with refused(match="cannot be read"):
        read_table(tmp_path / "nothing.csv")


def test_columns_may_come_in_any_order_and_name(tmp_path):
    (curve,), _ = read_tests(written(tmp_path, "bulge [mm],pressure [kPa]\n2,1\n3,2\n"), cases.blown, "height")
    assert (curve.control, curve.measure) == ("pressure", "height")
    assert curve.at.tolist() == [1e3, 2e3]


def test_a_field_has_places_and_displacements_for_every_level(tmp_path):
    text = "stretch [-],x [mm],y [mm],u [mm],v [mm]\n1.1,1,2,0.1,0.2\n1.1,3,4,,\n1.3,1,2,0.3,\n"
    fields, notes = read_tests(written(tmp_path, text), lambda stretch=1.3: cases.ogden_strip(stretch=stretch), None)
    assert [field.at for field in fields] == [1.1, 1.3]
    assert fields[0].places == pytest.approx(np.array([[1e-3, 2e-3]]))
    assert fields[0].displacements[0, :2] == pytest.approx([1e-4, 2e-4])
    assert np.isnan(fields[0].displacements[0, 2])
    assert np.isnan(fields[1].displacements[0, 1])
    assert notes == ["data.csv, line 3: the displacement is missing: the row is left out"]
    whole = "x [mm],y [mm],u [mm],v [mm]\n1,2,0.1,0.2\n"
    assert [field.at for field in read_tests(written(tmp_path, whole), cases.ogden_strip, None)[0]] == [1.0]
    with refused(match="column 'u' is a force: expected a length"):
        read_tests(written(tmp_path, "x [m],y [m],u [N],v [m]\n1,2,3,4\n"), cases.ogden_strip, None)


def test_shapes_of_data_are_checked():
    with refused(match="expected equal lengths"):
        Curve("pressure", np.ones(2), "height", np.ones(3))
    with refused(match="expected finite numbers"):
        Curve("pressure", np.ones(2), "height", np.array([1.0, np.nan]))
    with refused(match="no displacement is finite"):
        FieldData(np.ones((2, 2)), np.full((2, 3), np.nan))
