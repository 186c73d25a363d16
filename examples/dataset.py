"""A data set: pictures of one scene in known light with known BRDFs, and the parameters and curves of each.

.venv/bin/python examples/dataset.py
"""

import json
from pathlib import Path

import numpy as np

import insitu

ANGLES = np.linspace(0.0, np.pi / 2, 91)


def main(folder: Path, resolution: tuple[int, int] = (256, 256), n_pictures: int = 8, seed: int = 1) -> list[Path]:
    """Writes pictures as 0000.npy (H, W, 3) and what they show as 0000.json; the paths of the pictures."""
    random = np.random.default_rng(seed)
    scene = insitu.open("shapes", resolution=resolution)
    gloss = scene["cylinder"]["gloss"]
    paths = []
    for i in range(n_pictures):
        gloss.alpha = float(np.exp(random.uniform(np.log(0.05), np.log(0.6))))
        scene["cylinder"]["paint"].albedo = random.uniform(0.05, 0.8, 3)
        scene.light.rotation = float(random.uniform(0.0, 360.0))
        path = folder / f"{i:04d}.npy"
        np.save(path, scene.image(bounces=1))
        truth = {
            "rotation": scene.light.rotation,
            "albedo": scene["cylinder"]["paint"].albedo,
            "alpha": gloss.alpha,
            "theta_h": gloss["theta_h"](ANGLES).tolist(),
        }
        path.with_suffix(".json").write_text(json.dumps(truth), encoding="utf-8")
        paths.append(path)
    return paths


if __name__ == "__main__":
    out = Path("out/examples/dataset")
    out.mkdir(parents=True, exist_ok=True)
    main(out)
