"""A floor's images of bumps, for tests of pictures: they are told apart by closed forms."""

from pathlib import Path

import numpy as np
from PIL import Image

from tests.scene_text import facing_up

TILT = np.arctan(0.5)
FLOOR = facing_up(4)  # u along +X, v along -Z


def write_bump_images(folder: Path) -> Path:
    """Put into a folder a normal map that leans to the right by TILT, a flat one, and round bumps as heights."""
    lean = np.array([np.sin(TILT), 0.0, np.cos(TILT)])
    Image.fromarray(np.tile(np.round(128 + 127 * lean).astype(np.uint8), (4, 4, 1))).save(folder / "lean.png")
    Image.fromarray(np.tile(np.uint8([128, 128, 255]), (4, 4, 1))).save(folder / "flat.png")
    u = (np.arange(64) + 0.5) / 32 * np.pi
    heights = 0.5 + 0.25 * (np.sin(u)[:, None] + np.sin(u))
    Image.fromarray(np.round(65535 * heights).astype(np.uint16)).save(folder / "bumps.png")
    return folder
