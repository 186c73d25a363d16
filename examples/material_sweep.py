"""Sweep a parameter of a material: one picture a value, by the same light and shadows.

.venv/bin/python examples/material_sweep.py
"""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

import insitu

VALUES = (0.05, 0.1, 0.2, 0.4)


def main(
    folder: Path, resolution: tuple[int, int] = (512, 512), values: Sequence[float] = VALUES
) -> dict[float, np.ndarray]:
    """Writes alpha_VALUE.png of each roughness; the pictures."""
    scene = insitu.open("teatray", resolution=resolution)
    handles = scene["handles"]["brushed"]
    pictures = {}
    for alpha in values:
        handles.alpha = alpha  # the layer's transport is made anew; visibility and all other layers stay
        pictures[alpha] = scene.image()
        scene.save(folder / f"alpha_{alpha:g}.png")
    return pictures


if __name__ == "__main__":
    out = Path("out/examples/material_sweep")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
