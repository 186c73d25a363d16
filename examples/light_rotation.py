"""Turn the environment about the scene: shadows and highlights go around, geometry's visibility stays.

.venv/bin/python examples/light_rotation.py
"""

from pathlib import Path

import numpy as np

import insitu


def main(folder: Path, resolution: tuple[int, int] = (256, 256), n_steps: int = 8) -> list[float]:
    """Writes light_DEGREES.png in steps around; the mean radiance of each."""
    scene = insitu.open("teatray", resolution=resolution)
    scene.light.environment = "studio"
    means = []
    for degrees in np.arange(n_steps) * 360.0 / n_steps:
        scene.light.rotation = degrees
        scene.save(folder / f"light_{degrees:03.0f}.png")
        means.append(float(scene.image().mean()))
    return means


if __name__ == "__main__":
    out = Path("out/examples/light_rotation")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
