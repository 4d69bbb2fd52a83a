"""The folder of a run: what an earlier or a killed run left there is cleared, other files are kept."""

import shutil

import pytest
from helpers import NEO, refused, square
from small_runs import cli

from warp_pd import BondAssociated, Explicit, Fixed, Simulation
from warp_pd.run.folder import remember, run_summary, save_summary


def test_the_pictures_of_an_earlier_run_are_cleared_and_others_kept(ball, tmp_path):
    folder = tmp_path / "earlier"
    shutil.copytree(ball, folder)
    (folder / "mine.png").write_bytes(b"mine")
    done = cli(
        "run",
        "pressure",
        "--points",
        "9",
        "--device",
        "cpu",
        "--quiet",
        "--no-pictures",
        "--overwrite",
        "--out",
        folder,
    )
    assert done.exit_code == 0, done.output
    assert {p.name for p in folder.glob("*.png")} == {"mine.png"}


@pytest.mark.parametrize("again", [{"resume": True}, {"overwrite": True}])
def test_what_shows_a_shorter_run_does_not_stay(again, tmp_path):
    """Pictures, films and pages go when the run goes on or another takes its place; those of others stay."""

    def run(frames, **options):
        sheet, solver = square(7), Explicit(frames * 1e-3, frames=frames)
        scene = Simulation(sheet, BondAssociated(NEO), solver, [Fixed(sheet.edges())])
        scene.run(device="cpu", out=tmp_path, usd=False, **options)

    run(1)
    shown = ["sheet.png", "energy.svg", "film.gif", "turn.webp", "small.html", "view.html"]
    for name in [*shown, "mine.png", "mine.gif", "mine.html", "mine.csv"]:
        (tmp_path / name).write_text(name)
    save_summary(tmp_path, {**run_summary(tmp_path), "pictures": ["sheet.png", "energy.svg", "mine.csv"]})
    for name in ("turn.webp", "small.html"):
        remember(tmp_path, tmp_path / name)
    remember(tmp_path, tmp_path.parent / "mine.html")
    run(2, **again)
    numbers = {"frames.vtkhdf", "history.csv", "restart.npz", "summary.json"}
    mine = {"mine.png", "mine.gif", "mine.html", "mine.csv"}
    assert {path.name for path in tmp_path.iterdir()} == numbers | mine


def test_the_folder_of_a_fit_is_not_overwritten_by_a_run(tmp_path):
    """Its pictures and tables would stay and look like those of the run."""
    (tmp_path / "fit.json").write_text("{}")
    sheet = square(7)
    scene = Simulation(sheet, BondAssociated(NEO), Explicit(1e-3, frames=1), [Fixed(sheet.edges())])
    with refused(match=r"its fit\.json does not belong to a run; expected another folder$"):
        scene.run(device="cpu", out=tmp_path, overwrite=True)


@pytest.mark.parametrize("usd", [True, False])
def test_what_a_killed_run_left_unfinished_is_cleared(usd, tmp_path):
    left = [".animation.unfinished.usdc", ".frames.vtkhdf.unfinished", "restart.npz.part",
            "history.csv.part", "summary.json.part", "view.html.part", ".damage.png.unfinished"]  # fmt: skip
    sheet = square(7)
    simulation = Simulation(sheet, BondAssociated(NEO), Explicit(1e-3, frames=2), [Fixed(sheet.edges())])
    (tmp_path / ".mine.usdc").write_bytes(b"mine")
    for resume in (False, True):
        for name in left:
            (tmp_path / name).write_bytes(b"half")
        assert simulation.run(out=tmp_path, device="cpu", usd=usd, view=True, resume=resume).status == "finished"
        results = {"frames.vtkhdf", "history.csv", "restart.npz", "summary.json", "view.html"} | (
            {"animation.usd"} if usd else set()
        )
        assert {p.name for p in tmp_path.iterdir()} == {".mine.usdc"} | results


@pytest.mark.parametrize("asked", ["usd", "pictures", "view"])
def test_what_is_made_from_frames_needs_them(asked, tmp_path):
    """Pictures and page are not made unless they are asked for, the animation is."""
    sheet = square(7)
    simulation = Simulation(sheet, BondAssociated(NEO), Explicit(1e-3, frames=1), [Fixed(sheet.edges())])
    for options in ({}, {"out": tmp_path, "vtkhdf": False}):
        with refused(match=f"{asked}: made from frames.vtkhdf; expected a folder"):
            simulation.run(device="cpu", **options, **{asked: True})
    simulation.run(device="cpu", out=tmp_path)
    numbers = {"frames.vtkhdf", "history.csv", "restart.npz", "summary.json"}
    assert {p.name for p in tmp_path.iterdir()} == numbers | {"animation.usd"}
