"""The guides' pictures after chapter 3 of the thesis: `python -m assets.scripts.figures [FOLDER] [NAME ...]`.

Each is the whole window after a script of assets/scripts/figures. The measured cloth is no real measurement, since none
may be handed on with the program: it is a satin of the library, tabulated as a gonioreflectometer would, with noise and
gaps, written as a MERL file and imported like any other.
"""

from __future__ import annotations

import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from app.files.materials import Library
from engine.measured.sample_files import merl_bytes
from engine.render.tabulate import tabulate_layers

SCRIPTS = Path(__file__).with_name("figures")
SCENES = {
    "pearls_sigma": "earrings",
    "posts_fresnel": "earrings",
    "teapot_anisotropy": "teatray",
    "velvet": "earrings",
    "measured_cloth": "earrings",
    "curve_drawing": "shapes",
}
NOISE, MISSING = 0.15, 0.01


def measured_cloth() -> NDArray[np.float32]:
    """A table as a measurement of cloth would be (90, 90, 180, 3)."""
    *_, table = tabulate_layers(Library().entry("Satin, champagne").material.layers)
    assert not isinstance(table, float)
    generator = np.random.default_rng(7)
    seen = table >= 0.0
    noisy = table * np.exp(NOISE * generator.standard_normal(table.shape)).astype(np.float32)
    noisy[generator.random(table.shape[:3]) < MISSING] = -1.0
    return np.where(seen, noisy, table)


def take(name: str, folder: Path) -> None:
    """The picture `name`.png."""
    with tempfile.TemporaryDirectory() as work:
        if name == "measured_cloth":
            (Path(work) / "cloth.binary").write_bytes(merl_bytes(measured_cloth()))
            run(work, "import-brdf", "cloth.binary", "-o", "cloth.toml")
        run(work, "screenshot", SCENES[name], "-o", "window.png", "--script", str(SCRIPTS / f"{name}.toml"))
        shutil.copyfile(Path(work) / "window.png", folder / f"{name}.png")


def run(folder: str, *arguments: str) -> None:
    """A command of the program, where paths begin at `folder`."""
    subprocess.run([sys.executable, "-m", "app", *arguments], cwd=folder, check=True)


def main() -> None:
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "docs/images").resolve()
    for name in sys.argv[2:] or SCENES:
        take(name, folder)


if __name__ == "__main__":
    main()
