"""All operators on one curve, and what they make of its values.

.venv/bin/python examples/curve_operators.py
"""

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

import insitu

ANGLES = np.linspace(0.0, np.pi / 2, 10)
EDITS: dict[str, Callable[[insitu.Curve], None]] = {
    "generated": lambda curve: None,
    "translate y": lambda curve: curve.translate(y=0.2, region=(0.2, 0.4, 0.8, 1.2)),
    "translate x": lambda curve: curve.translate(x=0.1, region=(0.0, 0.3, 0.8, 1.2)),
    "amplify y": lambda curve: curve.amplify(y=2.0, region=(0.0, 0.0, 0.3, 0.6)),
    "amplify x": lambda curve: curve.amplify(x=1.5, region=(0.0, 0.0, 0.8, 1.4)),
    "red alone": lambda curve: curve.amplify(y=0.5, channels=(True, False, False)),
}


def main(resolution: tuple[int, int] = (512, 512)) -> dict[str, NDArray[np.float64]]:
    """Values (10, 3) under each operator alone, by its name."""
    scene = insitu.open("teatray", resolution=resolution)
    curve = scene["handles"]["brushed"]["theta_h"]
    values = {}
    for name, edit in EDITS.items():
        edit(curve)
        values[name] = curve(ANGLES)
        curve.reset()
    return values


if __name__ == "__main__":
    for name, values in main().items():
        print(f"{name:>12}", " ".join(f"{value:7.3f}" for value in values[:, 0]))
