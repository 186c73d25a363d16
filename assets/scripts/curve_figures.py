"""The guides' figures of curves, after [BenArtzi07]: `python -m assets.scripts.curve_figures [FOLDER]`.

phong_curves.png (fig. 3.1): the one curve of the Phong model, from dull to sharp. curve_operators.png (figs 9.1-9.4):
each operator's helper function over its base, and a curve before and after it. ratio.png (6.2.1): a ball whose streak
turns as the anisotropy ratio passes 1.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np
from matplotlib import pyplot as plt
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from app.measure.report import save_figure
from app.project.project import open_project
from assets.scripts.bounces import GAP
from engine.core.generators import run_to_end
from engine.curve.operators import HALF_PI, Operator, apply_operators, helper_function
from engine.material import MODELS, make_layer
from engine.precompute.direct.pipeline import FINAL, Placement
from engine.render.display import display_picture
from engine.render.still import StillLayer, render_still
from engine.scene.builtin import builtin_environments

EXPONENTS = (4.0, 16.0, 64.0, 256.0, 1024.0)
REGIONS = (0.3, 0.55, 0.85, 1.15)
OPERATORS = (
    ("Translate Y", "f + h", Operator("translate", "y", *REGIONS, magnitude=0.35)),
    ("Translate X", "f(h)", Operator("translate", "x", *REGIONS, magnitude=0.12)),
    ("Amplify Y", "f h", Operator("amplify", "y", *REGIONS, magnitude=2.2)),
    ("Amplify X", "f(h)", Operator("amplify", "x", *REGIONS, magnitude=1.2, baseline=0.3)),
)
INK, GREY, BEFORE = "#c77d12", "#8a8a8a", "#2f6690"
RATIOS, SIZE, BANDS = (40.0, 1.0, 1.0 / 40.0), 220, (32, 1)
BALL = """
version = 1
name = "ball"
[camera]
position = [0.0, 0.9, 2.2]
target = [0.0, 0.0, 0.0]
fov_y = 28.0
[environment]
file = "studio.exr"
[[object]]
name = "ball"
primitive = "sphere"
layer = [{ model = "ashikhmin_shirley_ratio", name = "brushed", n_u = 20.0, ratio = 40.0, scale = [0.85, 0.76, 0.62] }]
"""


def hill(x: NDArray[np.float64]) -> NDArray[np.float64]:
    """A curve with a shoulder, (N, 3)."""
    return np.repeat(
        (0.75 * np.exp(-((x / 0.55) ** 2)) + 0.35 * np.exp(-(((x - 0.8) / 0.16) ** 2)))[:, None], 3, axis=1
    )


def phong_curves() -> Figure:
    """f_A of Phong's model for each exponent."""
    x = np.linspace(0.0, HALF_PI, 721)
    figure, axes = plt.subplots(figsize=(4.2, 2.6), layout="constrained")
    for i, exponent in enumerate(EXPONENTS):
        curve = make_layer(MODELS["phong"], {"exponent": exponent}).curve("theta_r")
        shade = 0.75 - 0.75 * i / (len(EXPONENTS) - 1)
        axes.plot(np.degrees(x), curve(x)[:, 0] / curve(x[:1])[0, 0], color=str(shade), label=f"{exponent:g}")
    axes.set(xlabel="θr, degrees", ylabel="f / f(0)", xlim=(0, 90), ylim=(0, 1.05))
    axes.legend(title="exponent", frameon=False, fontsize=8)
    axes.spines[["top", "right"]].set_visible(False)
    return figure


def curve_operators() -> Figure:
    """A row for each operator: its helper function, and a curve before and after."""
    x = np.linspace(0.0, HALF_PI, 721)
    figure, rows = plt.subplots(len(OPERATORS), 2, figsize=(5.6, 7.2), layout="constrained", sharex=True)
    for (name, result, operator), (left, right) in zip(OPERATORS, rows, strict=True):
        helper, base = helper_function(operator, x)
        degrees = np.degrees(x)
        unit = np.degrees if operator.axis == "x" else np.asarray
        left.plot(degrees, unit(base), "--", color=GREY, lw=1)
        left.plot(degrees, unit(helper), color=INK)
        left.set_ylabel(f"{name}: h")
        right.plot(degrees, hill(x)[:, 0], "--", color=BEFORE, lw=1, label="f")
        right.plot(degrees, apply_operators([operator], hill)(x)[:, 0], color=INK, label=result)
        right.legend(frameon=False, fontsize=8)
        for axes in (left, right):
            axes.spines[["top", "right"]].set_visible(False)
            axes.axvspan(*np.degrees(REGIONS[1:3]), color=INK, alpha=0.10, lw=0)
            axes.axvspan(*np.degrees(REGIONS[::3]), color=INK, alpha=0.06, lw=0)
            axes.set_xlim(0, 90)
    for axes in rows[-1]:
        axes.set_xlabel("angle, degrees")
    return figure


def ratios(size: int = SIZE) -> NDArray[np.uint8]:
    """The ball for each ratio, beside each other (H, W, 3) sRGB."""
    parts: list[NDArray[np.uint8]] = []
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "studio.exr").write_bytes(Path(builtin_environments()["studio"]).read_bytes())
        Path(folder, "scene.toml").write_text(BALL, encoding="utf-8")
        for ratio in RATIOS:
            project = open_project(str(Path(folder, "scene.toml")), (size, size), [("ball.brushed.ratio", ratio)])
            layers = [StillLayer(i, layer, BANDS, True) for i, layer in project.indexed_layers]
            placement = Placement(project.scene, n_edge_rays=8)
            picture = run_to_end(render_still(placement, layers, project.sky, FINAL), lambda step: None)
            parts += [np.full((size, GAP, 3), 255, np.uint8), display_picture(picture)]
    return np.concatenate(parts[1:], axis=1)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images")
    save_figure(folder / "phong_curves.png", phong_curves())
    save_figure(folder / "curve_operators.png", curve_operators())
    Image.fromarray(ratios()).save(folder / "ratio.png", optimize=True)


if __name__ == "__main__":
    main()
