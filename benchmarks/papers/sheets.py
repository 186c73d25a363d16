"""Pictures beside each other, with a line of words above each column."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from PIL import Image, ImageDraw, ImageFont

Picture = NDArray[np.uint8]

CAPTION, GAP, FONT = 20, 6, 13


def sheet(columns: Sequence[str], rows: Sequence[Sequence[Picture]]) -> Picture:
    """Rows of pictures (H, W, 3) sRGB, all of one size, with white between them (H', W', 3)."""
    height, width = rows[0][0].shape[:2]
    image = Image.new("RGB", (len(columns) * (width + GAP) - GAP, CAPTION + len(rows) * (height + GAP) - GAP), "white")
    draw, font = ImageDraw.Draw(image), ImageFont.load_default(FONT)
    for i, words in enumerate(columns):
        draw.text((i * (width + GAP) + width // 2, CAPTION // 2), words, "black", font, anchor="mm")
    for j, row in enumerate(rows):
        for i, each in enumerate(row):
            image.paste(Image.fromarray(each), (i * (width + GAP), CAPTION + j * (height + GAP)))
    return np.asarray(image)


def closeup(picture: Picture, left: float, top: float, share: float) -> Picture:
    """A part of a picture, as large as the picture; left, top and share of its width and height, 0 to 1."""
    height, width = picture.shape[:2]
    x, y = round(left * width), round(top * height)
    part = Image.fromarray(picture).crop((x, y, x + max(1, round(share * width)), y + max(1, round(share * height))))
    return np.asarray(part.resize((width, height), Image.Resampling.NEAREST))


def difference(found: NDArray[np.floating], truth: NDArray[np.floating], brightest: float) -> Picture:
    """|found - truth| of radiances (H, W, 3) as grey (H, W, 3), white at `brightest` of the truth's mean."""
    off = np.abs(np.asarray(found, np.float64) - truth).mean(axis=2) / (brightest * (truth.mean() or 1.0))
    return np.repeat(np.rint(255.0 * np.clip(off, 0.0, 1.0))[..., None], 3, axis=2).astype(np.uint8)
