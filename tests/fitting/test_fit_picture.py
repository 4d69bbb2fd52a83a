"""The picture of a fit."""

from types import SimpleNamespace

import numpy as np

from warp_pd import Measure
from warp_pd.fitting import Curve
from warp_pd.fitting.columns import read_tests
from warp_pd.fitting.report import Fit
from warp_pd.viewer import plots


def test_axes_of_a_fit_have_si_units(tmp_path, monkeypatch):
    kept = []
    monkeypatch.setattr(plots, "save", lambda figure, path, **more: kept.append(figure))
    (tmp_path / "test.csv").write_text("pressure [kPa], height [mm]\n0, 0\n1, 2\n2, 5\n")
    measured = [Measure("height", "m", lambda built, frame: 0.0)]

    def build(pressure=1.0):
        return SimpleNamespace(measures=measured)

    (test,), _ = read_tests(tmp_path / "test.csv", build, None)
    named = Curve("stretch", np.array([1.0, 2.0]), "force", np.array([0.0, 3.0]), name="by hand")
    tests = [test, named]
    values = [each.values for each in tests]
    Fit.draw(SimpleNamespace(tests=tests, model=values, residuals=[0.0 * v for v in values]), tmp_path / "fit.png")
    axes = kept[0].axes
    assert [axes[k].get_ylabel() for k in (0, 2)] == ["height (m)", "force (N)"]
    assert [axes[k].get_xlabel() for k in (1, 3)] == ["pressure (Pa)", "stretch"]
