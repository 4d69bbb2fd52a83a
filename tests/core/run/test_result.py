"""What a result and a simulation show: text, tables, curves; and the progress in a notebook."""

import sys

import numpy as np
import pytest
from helpers import refused, square
from small_runs import simulate

from warp_pd import CriticalStretch, Explicit, Fixed, Measure, RigidBall
from warp_pd.output import notebook


def scene(**parts):
    sheet = square(9)
    return simulate(
        sheet,
        Explicit(0.01, frames=3),
        loads=[Fixed(sheet.edges("all"))],
        measures=[
            Measure("height", "m", lambda built, frame: frame.displacement[:, 2].max(), reference=1.0),
            Measure("share", "1", lambda built, frame: 0.5),
        ],
        **parts,
    )


@pytest.fixture(scope="module")
def result():
    return scene().run(device="cpu")


def test_a_simulation_prints_its_parts_in_short_lines():
    simulation = scene(damage=CriticalStretch(2.0), contact=RigidBall(0.01, (0.05, 0.05, 0.02), (0.0, 0.0, -1.0)))
    text = repr(simulation)
    for line in (
        "Sheet(0.1 x 0.1 m, 81 points, spacing 0.0125 m)",
        "BondAssociated(NeoHookean(1000, bulk=100000), weights='plain')",
        "Explicit(0.01, frames=3)",
        "Fixed(32 points)",
        "CriticalStretch(2)",
        "RigidBall(0.01, ",
        "height, share",
    ):
        assert line in text
    assert max(map(len, text.splitlines())) < 130 and len(text.splitlines()) < 12
    assert "<table>" in simulation._repr_html_() and "Fixed(32 points)" in simulation._repr_html_()


def test_a_result_prints_measures_beside_their_references(result):
    page = result._repr_html_()
    assert "(reference 1 m, error -100 %)" in page and "finished" in page and "<th" in page


def test_names_of_scenes_are_no_html(result):
    assert "<b>" not in notebook.html_table("<b>", [("<b>", "<b>")])


def test_curves_are_drawn_with_units(result, tmp_path):
    figure = result.plot("height", "kinetic", "strain")
    assert [axes.get_ylabel() for axes in figure.axes] == ["height (m)", "(J)"]
    assert [axes.get_xlabel() for axes in figure.axes] == ["time (s)", "time (s)"]
    drawn = figure.axes[1].lines[0].get_ydata()
    assert list(drawn) == [row["kinetic"] for row in result.history]
    assert figure._repr_png_()[:4] == b"\x89PNG"
    assert result.plot(against="kinetic", path=tmp_path / "curves.pdf").axes[0].get_xlabel() == "kinetic energy (J)"
    assert (tmp_path / "curves.pdf").read_bytes()[:4] == b"%PDF"


def test_a_sheet_draws_itself(tmp_path):
    figure = square(7).plot(tmp_path / "sheet.png")
    assert figure._repr_png_()[:4] == b"\x89PNG" and (tmp_path / "sheet.png").stat().st_size > 5000


def test_wrong_names_are_one_line(result):
    bare = simulate(square(7), Explicit(1e-4, frames=1)).run(device="cpu")
    for call, said in (
        (lambda: result.plot("heigth"), "did you mean 'height'"),
        (lambda: result.plot("height", against="tim"), "did you mean 'time'"),
        (lambda: result.plot("height", path="a.jpg"), "path = 'a.jpg'"),
        (bare.plot, "plot: the scene has no measures; expected columns of time"),
    ):
        with refused(said):
            call()


def test_the_history_is_a_table_of_pandas(result):
    pandas = pytest.importorskip("pandas")
    table = result.table()
    assert isinstance(table, pandas.DataFrame) and len(table) == 4
    assert table["kinetic"].tolist() == [row["kinetic"] for row in result.history]


def test_without_pandas_one_line_says_how_to_get_it(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with refused(match="pip install pandas"):
        result.table()


class ZMQInteractiveShell:
    """Stands for the shell of a notebook."""


def test_a_notebook_shows_the_progress_unless_it_is_told_otherwise(monkeypatch, capsys):
    assert not notebook.in_notebook()
    scene().run(device="cpu")
    assert "kernels ready" not in capsys.readouterr().err
    kernel = type(sys)("IPython")
    kernel.get_ipython = ZMQInteractiveShell
    monkeypatch.setitem(sys.modules, "IPython", kernel)
    monkeypatch.setitem(sys.modules, "ipywidgets", None)
    assert notebook.in_notebook()
    scene().run(device="cpu")
    said = capsys.readouterr().err
    assert "kernels ready" in said and "100%" in said
    scene().run(device="cpu", reporter=None)
    assert "kernels ready" not in capsys.readouterr().err


def test_prints_hold_no_array():
    assert len(repr(simulate(square(31), initial_velocity=np.zeros((961, 3))))) < 800
