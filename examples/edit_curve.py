"""Lift a highlight: an operator on one curve, the picture before and after, and the error of the result.

.venv/bin/python examples/edit_curve.py
"""

from pathlib import Path

import insitu


def main(folder: Path, resolution: tuple[int, int] = (512, 512)) -> float:
    """Writes before.png, after.png and a session; the estimated relRMSE of the second picture."""
    scene = insitu.open("teatray", resolution=resolution)
    scene.save(folder / "before.png")
    copper = scene["teapot"]["copper"]
    # A second, broad lobe: the curve is raised beyond its peak, in radians, and fades out to both sides.
    copper["gamma_alpha"].translate(y=0.4, region=(0.1, 0.2, 0.4, 0.7))
    scene.save(folder / "after.png")
    scene.save(folder / "edited.insitu")  # opens in the editor, with the operator on its curve
    return scene.error().overall


if __name__ == "__main__":
    out = Path("out/examples/edit_curve")
    out.mkdir(parents=True, exist_ok=True)
    print(f"relRMSE {main(out):.2%}")
