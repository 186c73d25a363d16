"""What is on screen, from linear light and the view's description alone: a slow twin of the display shaders, of what
lies over the picture, and of scopes."""

from __future__ import annotations

import numpy as np

from app.document.background import Background
from app.document.view_state import ViewState
from engine.core.colour import AnyView
from engine.light.environment import LUMINANCE
from engine.render.crop import Crop
from engine.render.display import display_values

SQUARE, DARK, LIGHT = 8, 0.30, 0.36  # of the checkerboard
STRIPE, CLIPPED, ZEBRA = 4, 254.5 / 255.0, 0.08
DIM = 0.6  # how much of black lies outside the crop


def shown_colours(
    light: np.ndarray, view: ViewState, background: Background, tone_mapping: AnyView, inspected: bool = True
) -> np.ndarray:
    """Colours (H, W, 3) in [0, 1] of light (H, W, 4) with its intensity; alpha is multiplied into it. inspected: with
    one channel alone, and stripes."""
    alpha = light[..., 3:].astype(np.float64)
    if inspected and view.picture_channel == "alpha":
        return np.repeat(alpha, 3, axis=2)
    exposed, behind = light[..., :3].astype(np.float64) * 2.0**view.exposure, np.zeros(3)
    is_transparent = background.kind == "transparent"
    if is_transparent:
        exposed = np.where(alpha > 0.0, exposed / np.where(alpha > 0.0, alpha, 1.0), 0.0)
    else:
        behind = np.array(background.colour) * 2.0**view.exposure
        exposed = exposed + (1.0 - alpha) * behind
    if inspected and view.picture_channel != "colour":
        one = (
            exposed @ LUMINANCE
            if view.picture_channel == "luminance"
            else exposed[..., ("red", "green", "blue").index(view.picture_channel)]
        )
        exposed = np.repeat(one[..., None], 3, axis=2)
    colours = display_values(exposed, 0.0, tone_mapping) ** (1.0 / view.gamma)
    rows, columns = np.indices(light.shape[:2])
    if inspected and view.zebra:
        striped = (colours.max(axis=2) >= CLIPPED) & ((columns + rows) // STRIPE % 2 == 0)
        colours = np.where(striped[..., None], ZEBRA, colours)
    if is_transparent:
        board = np.where((columns // SQUARE + rows // SQUARE) % 2 == 0, LIGHT, DARK)[..., None]
        colours = board + (np.where(alpha > 0.0, colours, 0.0) - board) * alpha
    return colours


def dimmed(colours: np.ndarray, crop: Crop | None) -> np.ndarray | None:
    """Colours of a picture, dim outside of its crop: where a pixel's centre is not within. None where no centre is: a
    crop has one pixel at least."""
    if crop is None:
        return colours
    height, width = colours.shape[:2]
    columns, rows = (np.arange(width) + 0.5) / width, (np.arange(height) + 0.5) / height
    inside = ((rows >= crop.upper) & (rows < crop.lower))[:, None] & (columns >= crop.left) & (columns < crop.right)
    if not inside.any():
        return None
    return np.where(inside[..., None], colours, (1.0 - DIM) * colours)
