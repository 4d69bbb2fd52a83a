"""Run every scene small, and draw one picture of all of them: docs/scenes.png.

    python tools/montage.py --jobs 2         runs what is missing in the work folder, then draws
    python tools/montage.py --only-page      draws from the runs in the work folder

It takes about ten minutes on two CPU cores.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from small_pictures import limit, shrunk
from study import DOCS, RUNS, Case, execute_all, run_tool, study_parser

from warp_pd.output.plots import frames_at, new_figure, save, thumbnail
from warp_pd.output.vtkhdf import read_series

COLUMNS, SIDE = 6, 2.0


@dataclass(frozen=True, eq=False)
class Small(Case):
    """A small run of a scene.

    Attributes:
        scene: Name of the scene.
        colour: Point field that colours it.
        settings: Arguments that differ from the defaults.
        share: Frame that is shown: the part of the run that it ends.
        above: Whether the sheet is seen from above.
    """

    scene: str
    colour: str = "u3"
    settings: Mapping[str, Any] = field(default_factory=dict)
    share: float = 1.0
    above: bool = False


SCENES = (
    Small("ball_penetration", "damage", {"points": 101}, share=0.95),
    Small("balloon", "u3", {"points": 10, "stretch": 1.6, "frames": 4}),
    Small("balloon_burst", "damage", {"points": 20}, share=0.5),
    Small("balloon_paths", "u3", {"points": 7}),
    Small("bimodular_bar", "u2", {"points": 60}, above=True),
    Small("bulge_test", "u3", {"points": 15}),
    Small("cantilever", "u2", {"points": 40}, above=True),
    Small("double_notch", "damage", {"points": 40, "duration": 1.3}, share=0.5, above=True),
    Small("dropped_ball", "u3", {"points": 25, "horizon": 2.015, "duration": 0.2, "frames": 40}, share=0.6),
    Small("drum", "u3", {"points": 31, "amplitude": 0.01, "duration": 1e-3, "frames": 10}, share=0.0),
    Small("edge_notch", "damage", {"points": 30, "horizon": 2.015}, share=0.62, above=True),
    Small("flaw_sensitivity", "damage", {"points": 30, "frames": 40}, above=True),
    Small("folded_sheet", "u3", {"points": 41, "frames": 40}, share=0.8),
    Small("glove", "u2", {"spacing": 5e-3, "load_steps": 2}, above=True),
    Small("holed_strip", "u1", {"points": 31, "stretch": 1.5}, above=True),
    Small("kapton_shear", "wrinkle_level", {"points": 57}, above=True),
    Small("metamaterial", "u1", {"points": 40, "horizon": 2.015}, above=True),
    Small("needle", "damage", {"points": 31, "frames": 20}),
    Small("notched_strip", "damage", {"points": 60, "law": "tension_field", "frames": 300}, share=0.243, above=True),
    Small("off_plane_load", "u3", {"points": 25, "horizon": 2.015, "speed": 2e-2, "duration": 3.0, "frames": 12},
          share=0.5),
    Small("off_plane_tear", "u3", {"points": 40, "speed": 2e-2, "travel": 0.06, "frames": 40},
          share=0.7),
    Small("out_of_plane", "u3", {"points": 31, "horizon": 2.015, "duration": 2.5, "frames": 10}),
    Small("precut_tear", "u3", {"points": 60, "frames": 60}, share=0.7),
    Small("pressure", "u3", {"points": 31}),
    Small("pressure_dynamic", "u3", {"points": 41, "horizon": 2.015, "frames": 20}, share=0.25),
    Small("pressure_static", "u3", {"points": 31, "horizon": 2.015}),
    Small("puncture", "damage", {"points": 31, "frames": 40}, share=0.36),
    Small("pure_shear_tear", "damage", {"points": 20, "frames": 40, "tearing_energy": 4.0}, share=0.85, above=True),
    Small("running_crack", "damage", {"points": 40, "overload": 1.3, "duration": 0.24, "frames": 45}, share=0.67,
          above=True),
    Small("slit_balloon", "u1", {"points": 16, "load_steps": 1}),
    Small("snap_through", "u3", {"points": 15}),
    Small("square_wrinkles", "wrinkle_level", {"points": 40}, above=True),
    Small("stable_crack", "damage", {"points": 16, "damage_length": 7.5e-3, "growth": 0.5, "load_steps": 3},
          above=True),
    Small("stretch", "u1", {"points": 30, "mode": "planar", "stretch": 2.0, "defect": "hole"}, above=True),
    Small("tension", "u2", {"points": 31}, above=True),
    Small("trousers", "damage", {"points": 24, "frames": 50}, share=0.5),
    Small("tube_bulge", "u3", {"points": 16}),
    Small("tube", "u3", {"points": 32, "frames": 3}),
    Small("two_sheets", "u1", {"points": 17, "frames": 20}),
    Small("visco_crack", "damage", {"points": 30, "horizon": 2.015, "law": "published", "failure": True,
                                    "energy": 3e6}, share=0.95, above=True),
    Small("visco_hole", "u1", {"points": 31, "horizon": 2.015, "stretch": 2.0, "load_steps": 3}, above=True),
    Small("visco_sheet", "u1", {"points": 21, "horizon": 2.015}, above=True),
)  # fmt: skip


def picture(work: Path, path: Path, cases: Sequence[Small] = SCENES) -> int:
    """One panel for each scene that has been run; gives their number."""
    shown = [case for case in cases if (work / case.name / "frames.vtkhdf").is_file()]
    if not shown:
        return 0
    rows = -(-len(shown) // COLUMNS)
    figure = new_figure(SIDE * COLUMNS, SIDE * rows)
    panels = figure.subplots(rows, COLUMNS, squeeze=False)
    for axes in panels.flat:
        axes.set_axis_off()
    for axes, case in zip(panels.flat, shown, strict=False):
        folder = work / case.name
        times = np.asarray(read_series(folder / "frames.vtkhdf").times)
        (frame,) = frames_at(folder, [float(times[round(case.share * (len(times) - 1))])])
        thumbnail(axes, frame, case.colour, (0.0, 1.0) if case.colour == "damage" else None, above=case.above)
        axes.set_title(case.scene, fontsize=8)
    save(figure, path)
    path.write_bytes(shrunk(path, limit(path)))
    return len(shown)


def main() -> None:
    """Run what is missing, then draw."""
    options = study_parser(
        __doc__, device="cpu", jobs=1, work=RUNS / "montage", out=DOCS / "scenes.png", only_page=False
    ).parse_args()
    execute_all(SCENES, options)
    print(f"{picture(options.work, options.out)} scenes in {options.out}")


if __name__ == "__main__":
    run_tool(main)
