"""Make the pictures of docs/ small: fewer colours first, then fewer pixels.

    python tools/small_pictures.py                     every picture without a palette, or larger than it may be
    python tools/small_pictures.py docs/scenes.png     these alone

Run it after a study has drawn its pictures. A page shows most of them 700 pixels wide; 40 kB are enough for that.
"""

from __future__ import annotations

import argparse
import io
from pathlib import Path

from PIL import Image
from study import DOCS, run_tool

# Bytes of a picture, and of those that a page shows large or that hold many panels.
USUAL = 40_000
LARGE = {"scenes.png": 70_000, "visco.png": 60_000, "fields.png": 100_000, "one-core.png": 60_000}
# Colours to try, most first, and how much narrower a picture gets when the fewest are not enough.
COLOURS, NARROWER = (128, 64, 48), 0.85


def limit(path: Path) -> int:
    """Bytes that a picture of docs/ may take."""
    return LARGE.get(path.name, USUAL)


def is_small(path: Path) -> bool:
    """Whether a picture has a palette and takes no more bytes than it may."""
    with Image.open(path) as picture:
        return picture.mode == "P" and path.stat().st_size <= limit(path)


def encoded(picture: Image.Image, colours: int) -> bytes:
    """A picture as PNG with a palette."""
    room = io.BytesIO()
    # Median cut is further off in colours that few pixels have, such as those of marks and lines.
    few = picture.quantize(colours, Image.Quantize.MAXCOVERAGE, kmeans=2, dither=Image.Dither.NONE)
    few.save(room, "png", optimize=True)
    return room.getvalue()


def shrunk(path: Path, most: int) -> bytes:
    """A picture as PNG of at most so many bytes, on white."""
    picture = Image.open(path).convert("RGBA")
    whole = Image.alpha_composite(Image.new("RGBA", picture.size, "white"), picture).convert("RGB")
    picture = whole
    while True:
        for colours in COLOURS:
            found = encoded(picture, colours)
            if len(found) <= most:
                return found
        width = round(NARROWER * picture.width)
        picture = whole.resize((width, round(whole.height * width / whole.width)), Image.Resampling.LANCZOS)


def main() -> None:
    """Re-encode what is too large."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("pictures", nargs="*", type=Path, help="files; by default all of docs/")
    for path in parser.parse_args().pictures or sorted(DOCS.rglob("*.png")):
        before = path.stat().st_size
        if not is_small(path):
            path.write_bytes(shrunk(path, limit(path)))
            print(f"{path}: {before / 1e3:.0f} -> {path.stat().st_size / 1e3:.0f} kB")


if __name__ == "__main__":
    run_tool(main)
