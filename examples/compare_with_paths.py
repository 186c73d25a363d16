"""Compare Placement with the path tracer: where the pictures differ, and by how much.

.venv/bin/python examples/compare_with_paths.py
"""

from pathlib import Path

import numpy as np

import insitu


def main(folder: Path, resolution: tuple[int, int] = (128, 128), samples: int = 256) -> tuple[float, float]:
    """Writes difference.npy, signed (H, W, 3); the relative differences: of means, and root of mean squares."""
    scene = insitu.open("cornell", resolution=resolution)
    found, expected = scene.image(bounces=2), scene.image("paths", bounces=2, samples=samples)
    difference = found - expected
    np.save(folder / "difference.npy", difference)
    mean = float(expected.mean())
    return float(difference.mean()) / mean, float(np.sqrt(np.mean(difference**2))) / mean


if __name__ == "__main__":
    out = Path("out/examples/compare_with_paths")
    out.mkdir(parents=True, exist_ok=True)
    of_means, of_squares = main(out)
    print(f"means differ by {of_means:+.2%}, root of mean squares {of_squares:.2%} (the paths' noise included)")
