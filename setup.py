"""Description for package indexes: README.md without pictures and links that only a copy of the repository has."""

import re
from pathlib import Path

from setuptools import setup

NOT_HERE = r"\((?!https?://)[^)]*\)"
WHERE = "\nPictures, and the pages that this text names, are in the folder `docs` of the source distribution.\n"


def description(readme: str) -> str:
    """The text of README.md, without relative pictures, their captions and relative links."""
    without = re.sub(rf"^!\[[^]]*\]{NOT_HERE}\n\n(?:\*[^*].*?\*\n\n)?", "", readme, flags=re.MULTILINE | re.DOTALL)
    return re.sub(rf"\[([^]]+)\]{NOT_HERE}", r"\1", without) + WHERE


setup(
    long_description=description((Path(__file__).parent / "README.md").read_text("utf-8")),
    long_description_content_type="text/markdown",
)
