"""The picture of a sweep."""

from matplotlib.figure import Figure

from warp_pd.output.curves import draw_sweep


def test_the_legend_names_only_what_varies(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("warp_pd.output.curves.save", lambda figure, path: drawn.append(figure))
    runs = [
        (
            {"points": points, "length": "0.01", "energy": energy},
            {"peak": {"value": 1.0, "unit": "N", "reference": None}},
        )
        for points in ("21", "41")
        for energy in ("2e3", "4e3")
    ]
    assert draw_sweep(tmp_path / "sweep.png", runs)
    (figure,) = drawn
    assert isinstance(figure, Figure)
    assert figure.axes[0].get_legend_handles_labels()[1] == ["energy=2e3", "energy=4e3"]
