"""The gallery has every scene, with picture, command and page; docs/ stays small."""

import re
import sys
from pathlib import Path

import gallery
import pytest
import small_pictures
from helpers import refused
from site_hooks import on_post_build

from warp_pd.__main__ import build_scene, scene_names

ROOT = Path(__file__).parents[2]
TEXT = gallery.gallery_page()
# Of the checkout: disks store whole blocks.
MOST, BLOCK = 5_000_000, 4096


@pytest.mark.parametrize("scene", sorted(gallery.SCENES))
def test_every_scene_has_a_picture_a_page_and_a_command(scene):
    page = gallery.GALLERY / f"{scene}.html"
    assert page.stat().st_size < 90_000
    text = page.read_text(encoding="utf-8")
    assert f'id="content">{{"title": "{scene}"' in text
    assert re.search(r'"version": "[\d.]+".*"date": "20[-\d]+T', text), "the page of the gallery says that it has both"
    assert f"[![{scene.replace('_', ' ')}](gallery/{scene}.png)](gallery/{scene}.html)" in TEXT
    settings = dict(re.findall(r"--set (\w+)=(\S+)", gallery.command(scene)))
    assert f"`{gallery.command(scene)}`" in TEXT
    if scene in ("balls_on_a_sheet", "gripper"):
        pytest.importorskip("newton", reason="newton, the extra `bodies`, is not installed")
    build_scene(scene, settings)


@pytest.mark.parametrize("scene", sorted(gallery.SCENES))
def test_a_gallery_page_loads_scripts_from_the_package(scene):
    text = (gallery.GALLERY / f"{scene}.html").read_text(encoding="utf-8")
    addresses = re.findall(r'(?:src|href)="([^"]*)"', text)
    package = {path.name for path in (ROOT / "warp_pd/viewer/page").iterdir() if path.suffix in (".js", ".css")}
    assert {Path(address).name for address in addresses} == package
    assert all((gallery.GALLERY / address).is_file() for address in addresses)
    assert not re.search(r"<script>|<style>", text)


def test_a_scene_without_a_page_of_its_own_is_on_the_page_that_the_gallery_names():
    assert sorted([*gallery.SCENES, *gallery.ELSEWHERE]) == scene_names()
    for scene, page in gallery.ELSEWHERE.items():
        assert f"`{scene}`" in (ROOT / "docs" / f"{page}.md").read_text()


def test_pages_are_made_of_the_runs_that_exist(tmp_path, monkeypatch):
    written = []
    (tmp_path / "gallery" / "needle").mkdir(parents=True)
    (tmp_path / "gallery" / "needle" / "frames.vtkhdf").touch()
    # Neither the browser nor docs/ is needed to see which scenes are drawn again.
    stubs = {"RUNS": tmp_path, "write_pages": written.extend, "write_overview": lambda path: None}
    for name, value in stubs.items():
        monkeypatch.setattr(gallery, name, value)
    monkeypatch.setattr(sys, "argv", ["gallery.py", "--only-page"])
    gallery.main()
    assert written == ["needle"]
    monkeypatch.setattr(sys, "argv", ["gallery.py", "--only-page", "--scenes", "needle", "drum"])
    with refused(match="--scenes drum: expected runs in"):
        gallery.main()


def test_pages_of_the_site_load_scripts_from_the_site(tmp_path):
    class Config:
        config_file_path, site_dir = ROOT / "mkdocs.yml", tmp_path

    (tmp_path / "gallery").mkdir()
    page = tmp_path / "gallery" / "needle.html"
    page.write_text((gallery.GALLERY / "needle.html").read_text(encoding="utf-8"), encoding="utf-8")
    on_post_build(Config)
    addresses = re.findall(r'(?:src|href)="([^"]*)"', page.read_text(encoding="utf-8"))
    assert len(addresses) == 8
    assert all((page.parent / address).resolve().is_relative_to(tmp_path) for address in addresses)
    assert all((page.parent / address).is_file() for address in addresses)


def test_pictures_are_small():
    large = [str(path) for path in sorted((ROOT / "docs").rglob("*.png")) if not small_pictures.is_small(path)]
    assert large == [], "run tools/small_pictures.py"


def test_docs_take_five_megabytes_at_most():
    sizes = [path.stat().st_size for path in (ROOT / "docs").rglob("*") if path.is_file()]
    assert sum(-(-size // BLOCK) * BLOCK for size in sizes) <= MOST
