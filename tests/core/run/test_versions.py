"""A run that another version continues says so."""

from helpers import NEO, StopAt, square

from warp_pd import BondAssociated, Explicit, Fixed, Simulation


def run(folder, **options):
    sheet = square(7)
    scene = Simulation(sheet, BondAssociated(NEO), Explicit(1e-3, frames=4), [Fixed(sheet.edges())])
    return scene.run(out=folder, device="cpu", usd=False, view=False, pictures=False, **options).summary


def test_a_run_that_another_version_continues_has_a_note(tmp_path, monkeypatch):
    assert run(tmp_path, writers=[StopAt(1)])["status"] == "interrupted"
    monkeypatch.setattr("warp_pd.run.recorder.code_version", lambda: "warp-pd 9.0 abc, Warp 1.19.0")
    run(tmp_path, resume=True, writers=[StopAt(2)])
    monkeypatch.undo()
    summary = run(tmp_path, resume=True)
    found = [note for note in summary["notes"] if note.startswith("resumed by another version")]
    assert len(found) == 1 and "warp-pd 9.0 abc" in found[0] and found[0].count(" s on;") == 3


def test_a_run_that_the_same_version_continues_has_none(tmp_path):
    assert run(tmp_path, writers=[StopAt(1)])["status"] == "interrupted"
    assert not [note for note in run(tmp_path, resume=True)["notes"] if "another version" in note]
