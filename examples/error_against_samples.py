"""How many samples a path tracer takes to come as close as Placement: relRMSE against the number of samples.

.venv/bin/python examples/error_against_samples.py
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import insitu


def relative_error(picture: NDArray[np.float32], reference: NDArray[np.float32]) -> float:
    """Root of the mean square difference over the reference's mean, both clamped at its 99.9th percentile."""
    top = np.percentile(reference, 99.9)
    difference = np.minimum(picture, top) - np.minimum(reference, top)
    return float(np.sqrt(np.mean(difference**2)) / np.minimum(reference, top).mean())


def main(
    resolution: tuple[int, int] = (96, 72), samples: Sequence[int] = (1, 4, 16, 64), n_reference: int = 512
) -> dict[str, float]:
    """Errors by name: of Placement, and of so many samples."""
    scene = insitu.open("shapes", resolution=resolution)
    reference = scene.image("paths", bounces=2, samples=n_reference)
    errors = {"placement": relative_error(scene.image(bounces=2), reference)}
    for n in samples:
        errors[f"{n} samples"] = relative_error(scene.image("paths", bounces=2, samples=n), reference)
    return errors


if __name__ == "__main__":
    for name, error in main().items():
        print(f"{name:>12} {error:8.2%}")
