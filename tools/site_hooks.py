"""What MkDocs does besides its own: the page of the gallery, and scripts of the package for the pages of its scenes."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from gallery import gallery_page
from mkdocs.structure.files import File

FOLDER = "warp_pd/viewer/page"


def on_files(files: Any, config: Any) -> Any:
    """Add the page of the gallery, which is made of the docstrings of the scenes."""
    files.append(File.generated(config, "gallery.md", content=gallery_page()))
    return files


def on_post_build(config: Any) -> None:
    """Copy the scripts and styles into the site, and point the pages of the gallery at the copy."""
    source, gallery = Path(config.config_file_path).parent / FOLDER, Path(config.site_dir) / "gallery"
    shutil.copytree(source, gallery / "page", ignore=shutil.ignore_patterns("*.html"), dirs_exist_ok=True)
    for path in gallery.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace(f'"../../{FOLDER}/', '"page/'), encoding="utf-8")
