"""Pictures of scenes that bring no function for them, and what the progress bar says."""

import contextlib
import io

import numpy as np
import pytest
from matplotlib.image import imread
from small_runs import cli

from warp_pd import BondAssociated, Explicit, NeoHookean, Place, Sheet, Simulation, placed, together
from warp_pd.interfaces import FrameReport
from warp_pd.output.progress import Progress
from warp_pd.run.folder import run_summary
from warp_pd.viewer import default_pictures as default_pictures_module
from warp_pd.viewer import pictures, plots
from warp_pd.viewer.default_pictures import _counts, _draw_numbers, _moves, _round_off, telling_frames
from warp_pd.viewer.pictures import frames_at

SCENE = """
from warp_pd import *

def build(load=0.02, torn=False):
    sheet = Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1000.0, points=9)
    right = sheet.edges("right")
    move = [{MOVE}]
    return Simulation(
        sheet, BondAssociated(NeoHookean(1e3, 1e5), weights="plain"), {SOLVER},
        [Fixed(sheet.edges("left")), *move], damage=CriticalStretch(1.05) if torn else None,
        measures=[Measure("end", "m", lambda built, frame: frame.displacement.max())],
    )
"""
PULL = "Motion(right, times=[0.0, 0.01], x=[0.0, load], y=0.0)"


def run(folder, solver, move, *arguments):
    (folder / "mine.py").write_text(SCENE.replace("{SOLVER}", solver).replace("{MOVE}", move))
    done = cli("run", folder / "mine.py", "--device", "cpu", "--no-usd", "--quiet", "--out", folder / "out", *arguments)
    assert done.exit_code == 0, done.output
    return sorted(path.name for path in (folder / "out").glob("*.*") if path.suffix in (".png", ".svg"))


def test_a_scene_without_a_function_is_drawn(tmp_path, default_pictures):
    options = "--set", "torn=true", "--fields", "damage,stretch,direction,cauchy"
    drawn = run(tmp_path, "Explicit(0.01, frames=4)", PULL, *options)
    assert drawn == ["damage.png", "energy.png", "measures.png", "sheet.png", "stress.png", "thickness.png"]
    last = frames_at(tmp_path / "out", [1.0])[0].fields
    np.testing.assert_array_equal(last["stress"], last["cauchy_1"])
    product = last["thickness"] * last["stretch_1"] * last["stretch_2"]
    assert np.isfinite(product).sum() == 72 and np.nanmax(np.abs(product - 1.0)) < 1e-6
    assert run_summary(tmp_path / "out")["pictures"] == drawn
    assert min(imread(tmp_path / "out" / name).shape[0] for name in drawn) > 300


def test_a_static_scene_is_drawn_over_the_load_factor(tmp_path, default_pictures):
    solver = "Newton(load_steps=2)"
    still = "Fixed(sheet.edges(), 'z'), Fixed(right, 'xy'), Pressure(5.0), Reaction(right, 'pull')"
    drawn = run(tmp_path, solver, still, "--pictures", "svg")
    assert drawn == ["energy.svg", "measures.svg", "sheet.svg"]
    # Matplotlib notes a text beside its outlines.
    energy, measures = ((tmp_path / "out" / name).read_text() for name in ("energy.svg", "measures.svg"))
    panels = measures.count("<!-- pull x (N) -->") + measures.count("<!-- pull z (N) -->") + 1
    assert panels > 1
    assert (energy.count("<!-- load factor -->"), measures.count("<!-- load factor -->")) == (1, panels)


def test_no_pictures(tmp_path, default_pictures):
    assert run(tmp_path, "Explicit(0.01, frames=1)", PULL, "--no-pictures") == []
    again = ("draw", tmp_path / "out", "--scene", tmp_path / "mine.py", "--pictures")
    drawn = cli(*again, "svg")
    assert drawn.exit_code == 0 and "sheet.svg" in drawn.output
    refused = cli(*again, "jpg")
    assert refused.exit_code == 2 and "pictures = 'jpg': expected one of 'png', 'pdf', 'svg'" in refused.output


def rows(damage):
    return [{"time": float(k), "mean_damage": d} for k, d in enumerate(damage)]


def test_frames_of_a_tear_are_before_at_its_beginning_half_way_and_at_the_end():
    slow = [0.1] * 21 + [0.1 + 0.01 * k for k in range(1, 10)] + [0.19] * 71
    assert telling_frames(rows(slow), 101) == [20, 21, 25, 100]
    at_once = [0.0] * 7 + [0.3] * 34
    assert telling_frames(rows(at_once), 41) == [6, 7, 23, 40]


def test_frames_of_a_sheet_that_does_not_tear_are_quarters_of_the_run():
    assert telling_frames(rows([0.1] * 41), 41) == [10, 20, 30, 40]
    assert telling_frames([{"time": 0.0}] * 3, 3) == [1, 2]
    assert telling_frames([{"time": 0.0}], 1) == [0]


def test_every_number_has_a_panel_and_a_constant_one_is_named(tmp_path):
    """Eleven measures that change, one that does not."""
    history = [{"time": 0.1 * k, "still": 1.0, **{f"number_{n}": float(n * k) for n in range(1, 12)}} for k in range(3)]
    units = {name: "m" for name in history[0] if name != "time"}
    columns = {name: history for name in units if name != "still"}
    with pictures.drawing(pictures.Drawing("mine", ("svg",))):
        _draw_numbers(tmp_path, columns, units, ["still"])
    drawn = (tmp_path / "measures.svg").read_text()
    assert all(f"<!-- number {n} (m) -->" in drawn for n in range(1, 12))
    assert "<!-- constant but for round-off, or missing: still -->" in drawn


def test_components_that_are_noise_are_left_out():
    history = [{"time": t, "ball_force_x": 1e-7 * t, "ball_force_z": t, "height": 1e-9 * t} for t in (0.0, 1.0, 2.0)]
    assert [name for name in history[0] if _counts(history, name)] == ["time", "ball_force_z", "height"]
    turning = [row | {"ball_torque_x": 1e-20 * row["time"], "pin_torque_z": 1e-20 * row["time"]} for row in history]
    assert [name for name in turning[0] if "torque" in name and _counts(turning, name)] == ["pin_torque_z"]


def test_numbers_that_are_round_off_have_no_panel():
    """Beside numbers of the same unit, the energy and the size of the sheet; or small changes of a number."""
    units = {"pull": "N", "side": "N", "end": "m", "drift": "m", "length": "m", "ratio": "1", "lone": "1"}
    history = [
        {"time": t, "strain": 0.1 * t, "pull": 5.0 * t, "side": 1e-7 * t, "end": 0.05 * t, "drift": -2e-9 * t,
         "length": 0.1 + 1e-9 * t, "ratio": 1e-9 * t, "lone": 0.0}
        for t in (0.0, 1.0, 2.0)
    ]  # fmt: skip
    noise = _round_off(history, units, 0.1, 32)
    assert [name for name in units if _moves(history, name, noise, units)] == ["pull", "end", "ratio"]
    # Float64 carries these changes; and a force of nothing but rounding is small beside the energy over the size.
    fine = _round_off(history, units, 0.1, 64)
    assert [name for name in units if _moves(history, name, fine, units)] == [name for name in units if name != "lone"]
    alone = [{"time": row["time"], "strain": row["strain"], "side": row["side"]} for row in history]
    assert not _moves(alone, "side", _round_off(alone, units, 0.1, 32), units)


def test_pictures_know_what_supports_hold_in_all_components(tmp_path, monkeypatch, default_pictures):
    """Frames with a stride have other points: there all count."""
    framed, draw_sheet = [], default_pictures_module._draw_sheet

    def noted(folder, frames):
        framed.append([list(frame.held) for frame in frames][-1])
        draw_sheet(folder, frames)

    monkeypatch.setattr(default_pictures_module, "_draw_sheet", noted)
    move = "Motion(right, times=[0.0, 0.01], x=[0.0, load], y=0.0), Fixed(right, 'z'), Fixed([4], 'y')"
    run(tmp_path, "Explicit(0.01, frames=2)", move)
    edges = [k for k in range(81) if k % 9 in (0, 8)]
    assert framed == [edges]
    run(tmp_path, "Explicit(0.01, frames=2)", move, "--overwrite", "--stride", "2")
    assert framed[1:] == [[]]


def test_cycles_between_frames_are_drawn_from_the_fine_history(tmp_path, monkeypatch, default_pictures):
    """Frames at the ends of cycles see nothing of them."""
    drawn, draw_curves = {}, plots.draw_curves

    def noted(axes, history, names, against="time"):
        drawn.update({name: (len(history), np.ptp([row[name] for row in history])) for name in names})
        draw_curves(axes, history, names, against)

    monkeypatch.setattr(plots, "draw_curves", noted)
    cycles = "[Motion(right, times=[0.0, 0.005, 0.01, 0.015, 0.02], x=[0.0, load, 0.0, load, 0.0], y=0.0), "
    run(tmp_path, "Explicit(0.02, frames=2, history_every=2e-4)", cycles[1:] + "Reaction(right, 'pull')")
    assert drawn["end"][0] == 3 and drawn["pull_x"][0] == drawn["strain"][0] > 60
    assert drawn["pull_x"][1] > 0.1


@pytest.mark.parametrize("columns", [50, 140])
def test_the_progress_bar_says_the_time_first(columns, monkeypatch):
    """A narrow terminal cuts off what comes last."""

    class Terminal(io.StringIO):
        def isatty(self):
            return True

    screen = Terminal()
    monkeypatch.setenv("COLUMNS", str(columns))
    row = {"balance_error": 0.001, "largest_damage": 0.3}
    with contextlib.redirect_stderr(screen):
        progress = Progress()
        progress.begin("mine")
        progress.compiled(0.1)
        progress._bar.ncols = columns
        progress.frame(FrameReport("t = 0.25 s", 0.5, 1234.0, 10, row))
        progress.close()
    last = screen.getvalue().split("\r")[-1]
    assert "50%" in last and "t = 0.25 s" in last and ", t =" not in last and len(last.strip()) <= columns
    assert ("damage 0.30" in last) == (columns >= 80)


def test_pieces_are_displaced_from_where_they_were_placed(tmp_path):
    lower, upper = (Sheet.rectangle(0.1, 0.1, thickness=1e-3, density=1e3, points=9) for _ in range(2))
    sheet = together(lower, upper)
    start = placed(sheet, Place(), Place(offset=(0.0, 0.0, 0.03)))
    Simulation(
        sheet, BondAssociated(NeoHookean(1e3, 1e5), horizon=1.5), Explicit(1e-3, frames=1),
        initial_displacement=start, initial_velocity=np.tile([2.0, 0.0, 0.0], (sheet.size, 1)),
    ).run(device="cpu", out=tmp_path, pictures=False, view=False, usd=False)  # fmt: skip
    first, last = frames_at(tmp_path, [0.0, 1e-3])
    assert not first.fields["u"].any() and np.ptp(last.points[:, 2]) == pytest.approx(0.03)
    np.testing.assert_allclose(last.fields["u1"], 2e-3, rtol=1e-4)
    np.testing.assert_allclose(last.reference + last.fields["displacement"], last.points, atol=1e-7)
