"""A writer of one OBJ file per frame."""

from pathlib import Path

import numpy as np

from warp_pd.interfaces import Writer
from warp_pd.run.folder import write_atomically


class ObjWriter(Writer):
    """Writes frame-0000.obj, frame-0001.obj, ... into a folder; any program for meshes reads them."""

    def __init__(self, folder, sheet):
        self.folder, self.sheet = Path(folder), sheet
        self.folder.mkdir(parents=True, exist_ok=True)

    def write(self, frame):
        reference = np.column_stack([self.sheet.points, np.zeros(self.sheet.size)])
        faces = self.sheet.triangles if frame.intact_faces is None else self.sheet.triangles[frame.intact_faces]
        lines = [f"# t = {frame.time:.9g} s"]
        lines += [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in reference + frame.displacement]
        lines += [f"f {a} {b} {c}" for a, b, c in faces + 1]
        write_atomically(self.folder / f"frame-{frame.index:04d}.obj", "\n".join(lines) + "\n")

    def save(self):
        """Every file is on the disk already."""

    def close(self):
        """No file is open."""
