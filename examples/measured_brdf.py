"""Put a measured BRDF (MERL's .binary, Cornell's .brdf) onto an object, and edit its highlight.

.venv/bin/python examples/measured_brdf.py FILE
"""

import sys
from pathlib import Path

import insitu


def main(file: Path, folder: Path, resolution: tuple[int, int] = (512, 512)) -> list[str]:
    """Writes measured.png and edited.png; the names of the layers that the measurement became."""
    scene = insitu.open("shapes", resolution=resolution)
    sphere = scene["sphere"]
    sphere.material = str(file)
    scene.save(folder / "measured.png")
    gloss = next(sphere[layer] for layer in sphere if sphere[layer].model == "measured")
    gloss["theta_h"].amplify(y=2.0, region=(0.0, 0.0, 0.2, 0.4))
    scene.save(folder / "edited.png")
    return list(sphere)


if __name__ == "__main__":
    out = Path("out/examples/measured_brdf")
    out.mkdir(parents=True, exist_ok=True)
    print("layers:", ", ".join(main(Path(sys.argv[1]), out)))
