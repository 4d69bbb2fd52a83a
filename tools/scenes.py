"""Run the scenes, and write their numbers to a page: every scene, or those of the VE paper at its sizes.

    python tools/scenes.py --device cuda:0 --jobs 4        docs/scenes.md
    python tools/scenes.py --page visco --device cuda:0    docs/visco.md
    python tools/scenes.py --scene puncture trousers       runs these and renews their sections
    python tools/scenes.py --only-page                     from the runs in the work folder

It takes a few minutes on one H200 and some hours on two CPU cores. A section whose run is not in the work folder stays
as it is on the page. `tools/gallery.py` makes the picture of all scenes, docs/scenes.png; docs/ball.png is the picture
damage.png of `ball_penetration`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

from study import DOCS, RUNS, Case, execute_all, renew, run_tool, study_parser, table


@dataclass(frozen=True, eq=False)
class SceneCase(Case):
    """A scene with some settings.

    Attributes:
        scene: Name of the scene.
        title: For the page.
        settings: Arguments of the scene that differ from their defaults.
    """

    scene: str
    title: str
    settings: Mapping[str, Any] = field(default_factory=dict)


SCENES = (
    SceneCase("tension", "BA 6.1 tension", {"points": 101}),
    SceneCase("pressure", "BA 6.2 pressure", {"points": 101}),
    SceneCase("double_notch", "BA 6.3 two notches", {"critical_stretch": 2.0}),
    SceneCase("off_plane_load", "BA 6.4 off-plane load"),
    SceneCase("off_plane_load", "BA 6.4, plain weights", {"weights": "plain"}),
    SceneCase("off_plane_load", "BA 6.4, published weights", {"weights": "published"}),
    SceneCase(
        "off_plane_load", "BA 6.4, published weights, boundary force", {"weights": "published", "boundary_force": 1e16}
    ),
    SceneCase("off_plane_load", "BA 6.4, plain weights, boundary force", {"weights": "plain", "boundary_force": 1e16}),
    SceneCase("off_plane_load", "BA 6.4, corrected weights, horizon 2.015", {"horizon": 2.015}),
    SceneCase("off_plane_tear", "BA 6.5 off-plane tear", {"critical_stretch": 2.0}),
    SceneCase("off_plane_tear", "BA 6.5 off-plane tear, ten times as fast", {"critical_stretch": 2.0, "speed": 4e-3}),
    SceneCase("pressure_static", "NN 6.1 pressure, 20 Pa"),
    SceneCase("pressure_static", "NN 6.1 pressure, 10 Pa", {"pressure": 10.0}),
    SceneCase("pressure_dynamic", "NN 6.1 sudden pressure"),
    SceneCase("out_of_plane", "NN 6.2 lifted sheet"),
    SceneCase("precut_tear", "NN 6.3 running slit", {"critical_stretch": 1.3}),
    SceneCase("ball_penetration", "NN 6.4 ball", {"critical_stretch": 1.3}),
    SceneCase("stretch", "HE 5 stretched sheet with a hole", {"mode": "equibiaxial", "defect": "hole"}),
    SceneCase("bimodular_bar", "IM 6.1 bar"),
    SceneCase("cantilever", "IM 6.2 cantilever"),
    SceneCase("square_wrinkles", "IM 6.3 square"),
    SceneCase("kapton_shear", "IM 6.4 sheared Kapton"),
    SceneCase("notched_strip", "IM 6.5 notched strip"),
    SceneCase("pure_shear_tear", "Pure shear, torn"),
    SceneCase("trousers", "Trousers"),
    SceneCase("edge_notch", "Notch at an edge"),
    SceneCase("running_crack", "Crack that runs along a strip"),
    SceneCase("flaw_sensitivity", "Small and large flaws"),
    SceneCase("puncture", "Ball through a slit"),
    SceneCase("cutting", "Blade that cuts", {"points": 30}),
    SceneCase("stable_crack", "Crack that grows at rest"),
    SceneCase("bulge_test", "Bulge test"),
    SceneCase("holed_strip", "Strip with a hole"),
    SceneCase("drum", "Drum, struck", {"points": 31, "amplitude": 0.01, "duration": 1e-3, "frames": 10}),
    SceneCase("balloon", "Balloon", {"points": 10, "stretch": 1.6, "frames": 4}),
    SceneCase("balloon_paths", "Balloon along its whole path"),
    SceneCase("snap_through", "Disc that snaps"),
    SceneCase("balloon_burst", "Balloon that bursts", {"points": 16}),
    SceneCase("tube_bulge", "Tube that bulges"),
    SceneCase("slit_balloon", "Slit in a long balloon"),
    SceneCase("tube", "Tube, pulled and inflated", {"points": 32, "frames": 3}),
    SceneCase("glove", "Glove from an SVG file", {"spacing": 5e-3, "load_steps": 2}),
    SceneCase(
        "dropped_ball", "Ball dropped on a trampoline",
        {"points": 25, "horizon": 2.015, "duration": 0.2, "frames": 40},
    ),
    SceneCase("needle", "Needle", {"points": 31, "frames": 20}),
    SceneCase("balls_on_a_sheet", "A dozen balls", {"points": 21, "duration": 0.3, "frames": 30}),
    SceneCase("gripper", "Gripper", {"points": 31, "frames": 30}),
    SceneCase("folded_sheet", "Strip that folds", {"points": 41, "frames": 40}),
    SceneCase("two_sheets", "A sheet pulled over another one", {"points": 17, "frames": 20}),
    SceneCase("wrinkles", "Wrinkles of a stretched strip"),
    SceneCase("peel", "Glued strips peeled apart", {"points": 31}),
    SceneCase("lap_joint", "Lap joint"),
    SceneCase("patched_sheet", "A patch over a slit"),
)  # fmt: skip


def of_ve(scene: str, title: str, settings: Mapping[str, Any] | None = None) -> SceneCase:
    """A scene with as many points along a side as the VE paper has."""
    return SceneCase(scene, title, {"points": 120 if scene == "metamaterial" else 100, **(settings or {})})


TEARS = {"failure": True}
VISCO = (
    of_ve("visco_sheet", "VE 6.1 sheet, no Prony term, stretch 4", {"viscous": False, "stretch": 4.0}),
    of_ve("visco_sheet", "VE 6.1, published law", {"viscous": False, "stretch": 4.0, "law": "published"}),
    of_ve("visco_sheet", "VE 6.5 sheet, 0.15 /s"),
    of_ve("visco_sheet", "VE 6.5, published law", {"law": "published"}),
    of_ve("visco_sheet", "VE 6.5 a hundred times as fast", {"rate": 15.0, "density": 1100.0}),
    of_ve("visco_hole", "VE 6.2 hole, stretch 4"),
    of_ve("visco_hole", "VE 6.2 hole, stretch 4, staircase", {"rim": "staircase"}),
    of_ve("visco_hole", "VE 6.2 hole, stretch 4, published law", {"law": "published"}),
    of_ve("visco_hole", "VE 6.2 hole, stretch 7", {"stretch": 7.0, "load_steps": 24}),
    of_ve("visco_hole", "VE 6.6 hole, 0.15 /s to 2.5", {"viscous": True, "stretch": 2.5}),
    of_ve("visco_hole", "VE 6.6 hole, 0.15 /s to 3", {"viscous": True, "stretch": 3.0}),
    of_ve("visco_crack", "VE 6.3 crack, stretch 1.5"),
    of_ve("visco_crack", "VE 6.3 crack, stretch 1.5, published law", {"law": "published"}),
    of_ve("visco_crack", "VE 6.3 crack, stretch 4", {"stretch": 4.0, "load_steps": 20}),
    of_ve("visco_crack", "VE 6.7 crack, 0.15 /s to 2.5", {"viscous": True, "stretch": 2.5}),
    of_ve(
        "visco_crack", "VE 6.3 crack that runs, Gc as printed", {**TEARS, "energy": 6.69, "law": "published"}
    ),
    of_ve("visco_crack", "VE 6.3 crack that runs, published law", {**TEARS, "law": "published"}),
    of_ve("visco_crack", "VE 6.3 crack that runs, stress-free law", TEARS),
    of_ve(
        "visco_crack", "VE 6.3 crack that runs, stress-free law that resists compression",
        {**TEARS, "wrinkles": "resolved"},
    ),
    of_ve(
        "visco_crack", "VE 6.7 crack that runs, published law", {**TEARS, "viscous": True, "law": "published"}
    ),
    of_ve("visco_crack", "VE 6.7 crack that runs, stress-free law", {**TEARS, "viscous": True}),
    of_ve("metamaterial", "VE 6.4 inclusions, stretch 1.5"),
    of_ve("metamaterial", "VE 6.4 inclusions and crack", {"crack": True}),
    of_ve("metamaterial", "VE 6.8 inclusions, 0.15 /s", {"viscous": True}),
    of_ve("metamaterial", "VE 6.8 inclusions and crack, 0.15 /s to 1.2", {"viscous": True, "crack": True}),
    of_ve(
        "metamaterial", "VE 6.4 inclusions and a crack that runs", {"crack": True, **TEARS, "law": "published"}
    ),
    of_ve(
        "metamaterial", "VE 6.4 inclusions and a crack that runs, stress-free law", {"crack": True, **TEARS}
    ),
    of_ve(
        "metamaterial", "VE 6.8 inclusions and a crack that runs",
        {"crack": True, **TEARS, "viscous": True, "law": "published"},
    ),
)  # fmt: skip
PAGES = {"scenes": SCENES, "visco": VISCO}


def section(case: SceneCase, summary: Mapping[str, Any]) -> list[str]:
    """Lines of markdown with the numbers of a run."""
    settings = "".join(f" --set {key}={value}" for key, value in case.settings.items())
    return [
        f"`warp-pd run {case.scene}{settings}`: {summary['points']} points, horizon {summary['horizon']}, "
        f"{summary['weights']} weights, float{summary['precision']}, {summary['steps']} steps in "
        f"{summary['wall_s'] - summary['compile_s']:.1f} s (and {summary['compile_s']:.1f} s of compilation); "
        f"{summary['status']} {summary['message']}".rstrip()
        + f", on {summary['device']}, {summary['date'][:10]}",
        "",
        *table(
            ["number", "of", "value", "reference", "error"],
            [cells(name, measure) for name, measure in summary["measures"].items()],
        ),
    ]


def cells(name: str, measure: Mapping[str, Any]) -> list[str]:
    """Cells of a reported number, beside its reference if it has one."""
    unit = "" if measure["unit"] == "1" else f" {measure['unit']}"
    value = "none" if measure["value"] is None else f"{measure['value']:.5g}{unit}"
    known = measure["reference"] is not None
    reference = f"{measure['reference']:.6g} ({measure['source']})" if known else ""
    error = f"{100.0 * measure['error']:+.3f} %" if known and measure["error"] is not None else ""
    return [name, measure["of"], value, reference, error]


def main() -> None:
    """Run what is missing, then renew the sections of the page."""
    parser = study_parser(__doc__, device="cpu", jobs=1, work=RUNS / "scenes", out=None, only_page=False)
    parser.add_argument("--page", choices=PAGES, default="scenes")
    names = sorted({case.scene for cases in PAGES.values() for case in cases})
    parser.add_argument("--scene", nargs="+", choices=names, default=names, metavar="SCENE", help="run these alone")
    options = parser.parse_args()
    cases = PAGES[options.page]
    execute_all([case for case in cases if case.scene in options.scene], options)
    found = {case: case.summary(options.work) for case in cases}
    sections = {f"## {case.title}": section(case, summary) for case, summary in found.items() if summary is not None}
    renew(options.out or DOCS / f"{options.page}.md", sections)


if __name__ == "__main__":
    run_tool(main)
