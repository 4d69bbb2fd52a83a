"""Sheets of too many triangles to be drawn one by one: pixels, the nearest to the eye."""

from __future__ import annotations

import numpy as np

# Pixels along the longer side of a panel, and samples of all triangles, about the most.
PIXELS, MOST_SAMPLES = 900, 12_000_000
# Parts of a pixel between two samples.
BETWEEN = 0.7


def raster(
    corners: np.ndarray, colours: np.ndarray, strokes: np.ndarray, inks: np.ndarray, lift: float
) -> tuple[np.ndarray, tuple[float, float, float, float]]:
    """An image of triangles and strokes, each pixel of what is nearest to the eye.

    Args:
        corners: Right, up and depth of the corners of triangles, shape (F, 3, 3).
        colours: Of the triangles: red, green, blue and opacity, shape (F, 4).
        strokes: Ends of the strokes, shape (S, 2, 3).
        inks: Of the strokes: colour and opacity, shape (S, 4).
        lift: How far a stroke may lie behind the triangle that it belongs to.

    Returns:
        The image, shape (rows, columns, 4), lowest row first, and its left, right, lower and upper end.
    """
    low, high = corners[..., :2].min(axis=(0, 1)), corners[..., :2].max(axis=(0, 1))
    pixel = float((high - low).max()) / PIXELS
    columns, rows = (np.ceil((high - low) / pixel).astype(int) + 1).tolist()
    image, nearest = np.zeros((rows * columns, 4)), np.full(rows * columns, -np.inf)
    sides = np.linalg.norm(corners[:, [1, 2, 0], :2] - corners[:, :, :2], axis=2).max(axis=1)
    per_side = np.maximum(np.ceil(sides / (BETWEEN * pixel)), 1.0)
    total = 0.5 * float((per_side**2).sum())
    per_side = np.maximum(per_side * min(1.0, np.sqrt(MOST_SAMPLES / total)), 1.0).astype(int)
    places, depths, owners = [], [], []
    for count in np.unique(per_side):
        chosen = np.flatnonzero(per_side == count)
        i, j = np.meshgrid(np.arange(count), np.arange(count), indexing="ij")
        i, j = i[i + j < count], j[i + j < count]
        weights = np.stack([i + 1.0 / 3.0, j + 1.0 / 3.0, count - i - j - 2.0 / 3.0], axis=1) / count
        samples = np.einsum("sk,fkc->fsc", weights, corners[chosen]).reshape(-1, 3)
        places.append(_pixels(samples, low, pixel, columns))
        depths.append(samples[:, 2])
        owners.append(np.repeat(chosen, len(weights)))
    place, depth, owner = (np.concatenate(parts) for parts in (places, depths, owners))
    # Of several samples in a pixel the last one stays.
    order = np.argsort(depth, kind="stable")
    image[place[order]], nearest[place[order]] = colours[owner[order]], depth[order]
    if len(strokes):
        _add_strokes(image, nearest, strokes, inks, lift, (low, pixel, columns))
    ends = (low[0], low[0] + columns * pixel, low[1], low[1] + rows * pixel)
    return image.reshape(rows, columns, 4), ends


def _pixels(samples: np.ndarray, low: np.ndarray, pixel: float, columns: int) -> np.ndarray:
    column, row = ((samples[:, c] - low[c]) / pixel for c in range(2))
    return np.asarray(row.astype(int) * columns + column.astype(int))


def _add_strokes(
    image: np.ndarray, nearest: np.ndarray, strokes: np.ndarray, inks: np.ndarray, lift: float,
    grid: tuple[np.ndarray, float, int],
) -> None:  # fmt: skip
    """Darken the pixels of the strokes that no triangle hides, each once."""
    low, pixel, columns = grid
    lengths = np.linalg.norm(strokes[:, 1, :2] - strokes[:, 0, :2], axis=1)
    counts = np.clip(np.ceil(lengths / (BETWEEN * pixel)), 1, PIXELS).astype(int)
    owner = np.repeat(np.arange(len(strokes)), counts)
    within = np.arange(len(owner)) - np.repeat(np.cumsum(counts) - counts, counts)
    fraction = ((within + 0.5) / counts[owner])[:, None]
    samples = strokes[owner, 0] + fraction * (strokes[owner, 1] - strokes[owner, 0])
    place = _pixels(samples, low, pixel, columns)
    seen = samples[:, 2] + lift >= nearest[place]
    place, first = np.unique(place[seen], return_index=True)
    ink = inks[owner[seen][first]]
    painted = image[place, 3] > 0.0
    place, ink = place[painted], ink[painted]
    image[place, :3] = (1.0 - ink[:, 3:]) * image[place, :3] + ink[:, 3:] * ink[:, :3]
