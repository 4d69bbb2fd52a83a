"""The gallery has every scene, with picture, command and page, and stays small."""

import re
from pathlib import Path

import gallery
import pytest

from warp_pd.__main__ import build_scene, scene_names
from warp_pd.output.packing import Arrays
from warp_pd.output.view import _html as page_of
from warp_pd.output.view import shared_files

ROOT = Path(__file__).parents[2]
TEXT = (ROOT / "docs" / "gallery.md").read_text()


def test_the_gallery_page_is_what_the_tool_makes_of_the_scenes():
    assert gallery.gallery_page() == TEXT


@pytest.mark.parametrize("scene", scene_names())
def test_every_scene_has_a_picture_a_page_and_a_command(scene):
    picture, page = gallery.GALLERY / f"{scene}.png", gallery.GALLERY / f"{scene}.html"
    assert picture.read_bytes()[:4] == b"\x89PNG" and picture.stat().st_size < 60_000
    assert page.stat().st_size < 600_000
    assert f'id="content">{{"title": "{scene}"' in page.read_text(encoding="utf-8")
    assert f"](gallery/{scene}.html)" in TEXT and f"(gallery/{scene}.png)" in TEXT
    settings = dict(re.findall(r"--set (\w+)=(\S+)", gallery.command(scene)))
    assert f"`{gallery.command(scene)}`" in TEXT
    build_scene(scene, settings)


def test_pages_of_the_gallery_share_the_scripts_and_styles_of_the_package():
    files = shared_files()
    assert {path.name for path in gallery.GALLERY.iterdir() if path.suffix in (".js", ".css")} == set(files)
    for name, text in files.items():
        assert (gallery.GALLERY / name).read_text(encoding="utf-8") == text, name


@pytest.mark.parametrize("scene", scene_names())
def test_a_page_of_the_gallery_holds_data_alone(scene):
    """The rest is what the package writes around the data of any run, with addresses that need no server."""
    text = (gallery.GALLERY / f"{scene}.html").read_text(encoding="utf-8")
    empty = page_of({"title": scene}, Arrays(), shared=".")
    data = r'<script type="(?:application/json|text/plain)" id="\w+">[^<]*</script>\n+'
    assert re.sub(data, "", text) == re.sub(data, "", empty)
    assert re.findall(r'(?:src|href)="([^"]*)"', text) == ["./page.css", "./vendor.js", "./page.js"]
