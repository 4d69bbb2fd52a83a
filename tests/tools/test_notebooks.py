"""The notebooks of the documentation, run as a reader runs them: by the kernel of a notebook."""

from pathlib import Path

import pytest

nbformat = pytest.importorskip("nbformat")
nbclient = pytest.importorskip("nbclient")
pytest.importorskip("ipykernel")
pytest.importorskip("pandas")

FOLDER = Path(__file__).parents[2] / "docs" / "notebooks"
SHOWN = {
    "first_steps.ipynb": {"image/png": 2, "<table>": 2, "dataframe": 1, "<iframe srcdoc=": 1},
    "data_sheet_to_tear.ipynb": {"image/png": 2, "<table>": 2, "<iframe srcdoc=": 1},
}


def test_every_notebook_is_run():
    assert {path.name for path in FOLDER.glob("*.ipynb")} == set(SHOWN)


@pytest.mark.parametrize("name", SHOWN)
def test_a_notebook_runs_and_shows_what_it_says(name, tmp_path, monkeypatch):
    monkeypatch.setenv("IPYTHONDIR", str(tmp_path / "ipython"))
    notebook = nbformat.read(FOLDER / name, as_version=4)
    assert not any(cell.get("outputs") for cell in notebook.cells), "commit notebooks without outputs"
    client = nbclient.NotebookClient(
        notebook, timeout=300, kernel_name="python3", resources={"metadata": {"path": str(tmp_path)}}
    )
    client.execute()
    outputs = [output for cell in notebook.cells if cell.cell_type == "code" for output in cell.outputs]
    data = [output["data"] for output in outputs if "data" in output]
    pages = "".join(str(found.get("text/html", "")) for found in data)
    for what, count in SHOWN[name].items():
        shown = sum("image/png" in found for found in data) if what == "image/png" else pages.count(what)
        assert shown >= count, f"{what}: {shown}"
    # The bar of the run, and nothing that went wrong.
    streams = "".join(output.get("text", "") for output in outputs if output.output_type == "stream")
    assert "kernels ready" in streams and "Warning" not in streams and "Traceback" not in streams
