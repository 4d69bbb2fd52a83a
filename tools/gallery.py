"""Run every scene small, and make the gallery: a picture and a page of each scene in docs/gallery/.

docs/scenes.png, which shows all scenes at once, is made of these pictures. The page of the gallery is made of the
docstrings of the scenes when the site is built (tools/site_hooks.py).

    python tools/gallery.py                        all scenes, some twenty minutes on two CPU cores
    python tools/gallery.py --scenes needle drum   these alone; the others keep their pictures and pages
    python tools/gallery.py --only-page            without running anything: pages of the runs in runs/gallery

Pictures are those of the pages, taken by Chromium. Pages of the gallery load the scripts and styles of the package in
this checkout; a page that `warp-pd view` writes has them inside.
"""

from __future__ import annotations

import ast
import io
import shutil
import subprocess
import sys
from collections.abc import Mapping, Sequence
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

from PIL import Image, ImageDraw, ImageFont
from small_pictures import encoded, limit, shrunk
from study import DOCS, ROOT, RUNS, run_tool, study_parser

from warp_pd import InputError
from warp_pd.__main__ import scene_names
from warp_pd.output.vtkhdf import read_series
from warp_pd.viewer.view import Limits, page

GALLERY = DOCS / "gallery"
# Where its pages find scripts and styles; the site has a copy, see tools/site_hooks.py.
SCRIPTS = "../../warp_pd/viewer/page"
# A picture in pixels and colours; and what a page holds: points of a long and of a short run, frames, bits a number.
WIDTH, HEIGHT, COLOURS = 720, 450, 96
POINTS, MOST_POINTS, FRAMES, BITS = 750, 1700, 16, 10
# The picture of all scenes: panels in a row, their size and that of a name in pixels; and the part of a picture without
# time and colour bar.
COLUMNS, PANEL, NAME, SEEN = 6, (136, 78), 14, (0, 40, 640, 405)


@dataclass(frozen=True)
class Shown:
    """How a scene is run and shown.

    Attributes:
        settings: Arguments of the scene that differ from their defaults.
        field: What the picture is coloured by; damage if there is any, else the displacement.
        share: Time of the picture as a share of the run.
        view: "3D", "top", "front", "side", or "" for the page's own.
    """

    settings: Mapping[str, Any] = field(default_factory=dict)
    field: str = ""
    share: float = 1.0
    view: str = ""


SCENES: dict[str, Shown] = {
    "ball_penetration": Shown({"frames": 60}, share=0.95),
    "balloon": Shown({"points": 12}, "displacement"),
    "balls_on_a_sheet": Shown({"points": 21, "duration": 0.12, "frames": 2}, "displacement along z"),
    "balloon_burst": Shown({"points": 24, "frames": 30}, share=0.5),
    "balloon_paths": Shown({"points": 7}, "displacement", 0.6, "3D"),
    "bimodular_bar": Shown({"points": 100}),
    "bulge_test": Shown({"points": 31}, "displacement along z", view="3D"),
    "cantilever": Shown({"points": 100}),
    "cutting": Shown({"points": 20, "frames": 50}, share=0.85, view="top"),
    "double_notch": Shown(
        {"points": 40, "duration": 1.3, "frames": 30, "slow_from": 0.94, "slow_to": 0.99}, "damage", 0.68, "top"
    ),
    "dropped_ball": Shown({"points": 31, "frames": 40}, "displacement along z", 0.32),
    "drum": Shown({"points": 41, "amplitude": 0.05, "frames": 40}, "displacement along z", 0.25, "3D"),
    "edge_notch": Shown({"points": 40, "horizon": 2.015, "frames": 60}, "damage", 0.93, "top"),
    "flaw_sensitivity": Shown({"points": 40, "frames": 60}, view="top"),
    "folded_sheet": Shown({"points": 61, "frames": 40}, "displacement", 0.7),
    "glove": Shown({"spacing": 4e-3}, "displacement"),
    "gripper": Shown({"points": 31, "duration": 0.034, "frames": 3}, view="top"),
    "holed_strip": Shown({"points": 41}, "displacement along x", view="top"),
    "kapton_shear": Shown({"points": 76, "tolerance": 1e-6}, "wrinkle level"),
    "metamaterial": Shown({"points": 30, "horizon": 2.015, "crack": True}),
    "needle": Shown({"points": 41, "frames": 40}, share=0.5),
    "notched_strip": Shown(
        {"points": 60, "law": "tension_field", "frames": 12, "slow_from": 0.71, "slow_to": 0.76}, "wrinkle state", 0.4
    ),
    "off_plane_load": Shown(
        {"points": 41, "horizon": 2.015, "speed": 5e-3, "duration": 12.0, "frames": 30},
        "displacement along z",
        view="top",
    ),
    "off_plane_tear": Shown({"points": 40, "speed": 2e-2, "travel": 0.06, "frames": 40}, share=0.75),
    "out_of_plane": Shown({"points": 51, "horizon": 2.015, "frames": 30}, "displacement along z"),
    "precut_tear": Shown({"points": 60, "frames": 60}, share=0.8),
    "pressure": Shown({}, "displacement along z"),
    "pressure_dynamic": Shown({"points": 51, "horizon": 2.015, "frames": 40}, "displacement along z", 0.8),
    "pressure_static": Shown({"points": 51, "horizon": 2.015}, "displacement along z"),
    "puncture": Shown({"points": 41, "frames": 40}, share=0.65),
    "pure_shear_tear": Shown({"points": 20, "frames": 60, "advance": 6.0}, share=0.6),
    "running_crack": Shown({"points": 40, "overload": 1.3, "duration": 0.24, "frames": 45}, share=0.67, view="top"),
    "slit_balloon": Shown({}, "displacement"),
    "snap_through": Shown({"points": 15}, "displacement along z", 0.75, "3D"),
    "square_wrinkles": Shown({"points": 48}, "wrinkle level"),
    "stable_crack": Shown({"load_steps": 4}, view="top"),
    "stretch": Shown({"defect": "hole", "stretch": 2.0}),
    "tension": Shown({}, "displacement along y"),
    "trousers": Shown({"points": 24, "frames": 50}, share=0.5, view="side"),
    "tube_bulge": Shown({"points": 16}, "displacement", 1.0, "3D"),
    "tube": Shown({"points": 48, "frames": 5}, "displacement"),
    "two_sheets": Shown({"points": 21, "frames": 30}, "displacement along x"),
    "visco_crack": Shown(
        {"points": 24, "horizon": 2.015, "law": "published", "failure": True, "energy": 3e6}, share=0.5
    ),
    "visco_hole": Shown({"points": 25, "horizon": 2.015, "stretch": 2.5, "load_steps": 5}),
    "visco_sheet": Shown({"points": 21, "horizon": 2.015}),
}
# Scenes whose picture is on another page, which keeps docs/ small.
ELSEWHERE = {
    "cyclic_strip": "visco",
    "rate_test": "papers/ve",
    "wrinkles": "bending",
    "lap_joint": "joints",
    "patched_sheet": "joints",
    "peel": "joints",
}


def command(scene: str) -> str:
    """What a user types to get the run of the gallery."""
    settings = " ".join(f"--set {name}={value}" for name, value in SCENES[scene].settings.items())
    return f"warp-pd run {scene} {settings}".replace("True", "true").strip()


def run_scene(scene: str) -> None:
    """Run a scene, small, into its folder."""
    folder = RUNS / "gallery" / scene
    arguments = [*command(scene).split()[1:], "--out", str(folder), "--overwrite"]
    arguments += ["--no-usd", "--no-pictures", "--no-view", "--quiet", "--device", "cpu"]
    done = subprocess.run(
        [sys.executable, "-m", "warp_pd.__main__", *arguments], cwd=ROOT, capture_output=True, text=True, check=False
    )
    # A run that did not converge has frames and a summary too; the page says how it ended.
    if done.returncode and not (folder / "summary.json").is_file():
        raise InputError(f"{command(scene)}: {done.stderr.strip().splitlines()[-1:]}")
    print(f"ran {command(scene)}", flush=True)


def write_pages(scenes: Sequence[str]) -> None:
    """The page of each scene, and its picture as the page shows it."""
    from playwright.sync_api import sync_playwright

    GALLERY.mkdir(exist_ok=True)
    with sync_playwright() as playwright:
        options = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]
        browser = playwright.chromium.launch(executable_path=shutil.which("chromium"), args=options)
        for scene in scenes:
            path = GALLERY / f"{scene}.html"
            text = _page_of(scene)
            path.write_text(text, encoding="utf-8")
            picture = _pictured(browser, path, SCENES[scene])
            (GALLERY / f"{scene}.png").write_bytes(picture)
            print(f"wrote {path} ({len(text) / 1e3:.0f} kB) and its picture ({len(picture) / 1e3:.0f} kB)", flush=True)
        browser.close()


def _page_of(scene: str) -> str:
    """The page of a run, small: without the velocity, which packs badly, and with fewer points the more frames."""
    folder = RUNS / "gallery" / scene
    info = read_series(folder / "frames.vtkhdf")
    points = min(MOST_POINTS, POINTS * FRAMES // min(FRAMES, info.frames))
    fields = [name for name in info.fields if name != "velocity"]
    return page(folder, Limits(points, FRAMES, fields, BITS), SCRIPTS)


def _pictured(browser: Any, path: Path, shown: Shown) -> bytes:
    """The picture of a page, with few colours."""
    opened = browser.new_page(viewport={"width": WIDTH, "height": 900})
    opened.goto(path.as_uri())
    opened.add_style_tag(content=f"#stage {{ height: {HEIGHT}px !important; background: #fff; border: none; }}")
    opened.add_style_tag(content="main { padding: 0 !important; } header { border: none !important; }")
    opened.wait_for_selector("body[data-ready]", state="attached")
    if shown.field:
        labels = opened.locator("#field option").all_inner_texts()
        opened.locator("#field").select_option(label=next(x for x in labels if x.split(" (")[0] == shown.field))
        opened.wait_for_selector(f"body[data-field='{shown.field}']", state="attached")
    last = int(opened.locator("#frame").get_attribute("max"))
    opened.locator("#frame").fill(str(round(shown.share * last)))
    if shown.view:
        opened.locator("#views button", has_text=shown.view).click()
    opened.wait_for_timeout(300)
    taken = Image.open(io.BytesIO(opened.locator("#stage").screenshot())).convert("RGB")
    opened.close()
    return encoded(taken, COLOURS)


def write_overview(path: Path) -> None:
    """One picture of all scenes."""
    pictures = sorted(GALLERY.glob("*.png"))
    width, height = PANEL[0], PANEL[1] + NAME
    whole = Image.new("RGB", (COLUMNS * width, -(-len(pictures) // COLUMNS) * height), "white")
    pen, font = ImageDraw.Draw(whole), ImageFont.load_default(10)
    for number, picture in enumerate(pictures):
        x, y = number % COLUMNS * width, number // COLUMNS * height
        pen.text((x + width // 2, y), picture.stem, "black", font, anchor="ma")
        panel = Image.open(picture).convert("RGB").crop(SEEN).resize(PANEL, Image.Resampling.LANCZOS)
        whole.paste(panel, (x, y + NAME))
    whole.save(path)
    path.write_bytes(shrunk(path, limit(path)))


def docstring(scene: str) -> str:
    """Docstring of a scene, without importing it."""
    source = (ROOT / "scenes" / f"{scene}.py").read_text("utf-8")
    return ast.get_docstring(ast.parse(source)) or ""


def gallery_page() -> str:
    """Text of gallery.md: the scenes as their docstrings tell."""
    lines = [
        "# Gallery",
        "",
        "Every scene that comes with the package, at sizes that a laptop runs in seconds to a few minutes. Follow a "
        "picture to its page: turn the sheet, play it, and choose what colours show. A page names the version and the "
        "date of its run, which may be older than this one. Every run of your own writes such a page; see "
        "[A run in the browser](viewing.md). `warp-pd run SCENE --help` lists the arguments of a "
        "scene; a run prints its measures beside their references.",
    ]
    for scene in scene_names():
        title, _, text = docstring(scene).partition("\n")
        first = " ".join(text.strip().split("\n\n")[0].split())
        if scene in ELSEWHERE:
            page = ELSEWHERE[scene]
            lines += ["", f"## {scene.replace('_', ' ')}", "", f"{title} Shown in [{page}]({page}.md)."]
            continue
        lines += [
            "", f"## {scene.replace('_', ' ')}", "",
            f"[![{scene.replace('_', ' ')}](gallery/{scene}.png)](gallery/{scene}.html)", "",
            f"{title} {first}".strip(), "", f"`{command(scene)}` \u00b7 [page](gallery/{scene}.html)",
        ]  # fmt: skip
    return "\n".join(lines) + "\n"


def main() -> None:
    """Run what is asked for, then write pictures and pages."""
    parser = study_parser(__doc__, only_page=False, jobs=1)
    parser.add_argument("--scenes", nargs="*", default=[], help="Names of scenes; all by default.")
    options = parser.parse_args()
    missing = sorted(set(scene_names()) ^ {*SCENES, *ELSEWHERE})
    if missing:
        raise InputError(f"SCENES: expected every scene once; look at {', '.join(missing)}")
    scenes = options.scenes or sorted(SCENES)
    if options.only_page:
        there = [scene for scene in scenes if (RUNS / "gallery" / scene / "frames.vtkhdf").is_file()]
        if options.scenes and there != scenes:
            raise InputError(f"--scenes {' '.join(sorted({*scenes} - {*there}))}: expected runs in {RUNS / 'gallery'}")
        scenes = there
    else:
        with ThreadPoolExecutor(options.jobs) as pool:
            list(pool.map(run_scene, scenes))
    write_pages(scenes)
    write_overview(DOCS / "scenes.png")


if __name__ == "__main__":
    run_tool(main)
