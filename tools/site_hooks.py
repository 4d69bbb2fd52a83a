"""What MkDocs does besides its own: the pages of the gallery and of the kernels, scripts for the pages of scenes."""

from __future__ import annotations

import shutil
from pathlib import Path
from typing import Any

from gallery import gallery_page
from mkdocs.structure.files import File

FOLDER = "warp_pd/viewer/page"
KERNELS = Path(__file__).parents[1] / "kernels"
# Kernels that materials, parts and shapes outside the package use: the page shows their functions, too.
OFFERED = (
    "bits", "contact.distances", "effects", "families", "family_sums", "incompressible", "kinematics", "materials",
    "numeric", "papers.bonds", "pointwise", "rupture",
)  # fmt: skip
ABOUT_KERNELS = """# Kernels

The device side: Warp functions and kernels, one file per piece of physics, each with its equations at the top.
Installed as `warp_pd.kernels`. [Architecture](../architecture.md) explains how the launches of a step are composed,
and [write your own part](../write-your-own-part.md) how they are used outside the package.

Any object with `constants` and `functions` is a material ([`Material`][warp_pd.Material]). `functions` is a cached
factory: it takes the precision in bits and returns the Warp functions stress and energy described under `materials`.
`response` enables Newton's method and the fictitious density of dynamic relaxation, `near` the fast kernels,
`membrane` the neural law. A pairwise material of the bond-based law has `constants` and `pairwise`
([`PairwiseMaterial`][warp_pd.PairwiseMaterial]).
"""


def on_files(files: Any, config: Any) -> Any:
    """Add the pages that are made of docstrings: the gallery, of the scenes, and the kernels."""
    files.append(File.generated(config, "gallery.md", content=gallery_page()))
    files.append(File.generated(config, "api/kernels.md", content=kernels_page()))
    return files


def kernels_page() -> str:
    """Text of api/kernels.md: a section for each folder, in it each file."""
    lines = [ABOUT_KERNELS]
    for folder in (KERNELS, *sorted(path for path in KERNELS.iterdir() if (path / "__init__.py").is_file())):
        lines += [f"## {folder.name if folder != KERNELS else 'Core'}", ""]
        for path in sorted(folder.glob("[!_]*.py")):
            name = ".".join(path.relative_to(KERNELS).with_suffix("").parts)
            shown = "" if name in OFFERED else "    options: {members: false}\n"
            lines.append(f"### {path.stem}\n\n::: kernels.{name}\n{shown}")
    return "\n".join(lines)


def on_post_build(config: Any) -> None:
    """Copy the scripts and styles into the site, and point the pages of the gallery at the copy."""
    source, gallery = Path(config.config_file_path).parent / FOLDER, Path(config.site_dir) / "gallery"
    shutil.copytree(source, gallery / "page", ignore=shutil.ignore_patterns("*.html"), dirs_exist_ok=True)
    for path in gallery.glob("*.html"):
        text = path.read_text(encoding="utf-8")
        path.write_text(text.replace(f'"../../{FOLDER}/', '"page/'), encoding="utf-8")
