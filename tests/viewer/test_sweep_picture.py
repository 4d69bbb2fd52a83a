"""The picture of a sweep."""

import itertools

from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from warp_pd.viewer.curves import draw_sweep


def test_the_legend_names_only_what_varies(tmp_path, monkeypatch):
    drawn = []
    monkeypatch.setattr("warp_pd.viewer.curves.save", lambda figure, path: drawn.append(figure))
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


def test_labels_do_not_overlap_and_the_legend_hides_no_curve(tmp_path, monkeypatch):
    """Long names along the axis, long names of measures, and many curves."""
    drawn = []
    monkeypatch.setattr("warp_pd.viewer.curves.save", lambda figure, path: drawn.append(figure))
    for values in (["NeoHookean", "MooneyRivlin", "ArrudaBoyce", "TensionField"], ["100000", "100001", "100002"]):
        runs = [
            ({"rubber": rubber, "tearing_energy": energy}, {
                name: {"value": float(k), "unit": "J/m^2", "reference": None}
                for name in ("tearing_energy_of_the_whole_strip_over_its_crack_at_the_end_of_the_run", "peak")
            })
            for rubber in values for k, energy in enumerate(("2000.5", "4000.5", "8000.5", "16000.5"))
        ]  # fmt: skip
        assert draw_sweep(tmp_path / "sweep.png", runs)
        figure = drawn[-1]
        FigureCanvasAgg(figure).draw()
        panels = figure.axes
        texts = []
        for axes in panels:
            low, high = axes.get_xlim()
            ticks = zip(axes.get_xticks(), axes.get_xticklabels(), strict=True)
            texts += [label for place, label in ticks if low <= place <= high]
        texts += [label for axes in panels for label in (axes.xaxis.label, axes.yaxis.label)]
        corners = [text.get_tightbbox().corners() for text in texts]
        assert all((corner >= 0.0).all() for corner in corners)
        # A turned label is a band; of level ones the boxes must be apart.
        level = [text.get_window_extent() for text in texts if text.get_rotation() in (0.0, 90.0)]
        assert not any(a.overlaps(b) for a, b in itertools.combinations(level, 2))
        (legend,) = figure.legends
        assert len(legend.get_texts()) == 4
        assert all(not legend.get_window_extent().overlaps(axes.get_window_extent()) for axes in panels)
        turned = {label.get_rotation() for label in panels[0].get_xticklabels()}
        assert turned == ({30.0} if values[0] == "NeoHookean" else {0.0})
