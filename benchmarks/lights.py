"""How far lamps for lights without size are from closed forms: `python -m benchmarks.lights` prints the table of
docs/measured-changes.md.

A floor lies under one light of KHR_lights_punctual, 1.5 m above it, and is seen from above, from so far away that
pixels are squares of it. Its radiance is the albedo over pi times the light's irradiance: I(theta) cos / d² of a point
or a spot, E cos of a directional light.
"""

from __future__ import annotations

import math
import tempfile
from collections.abc import Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

import insitu
from engine.scene.loaders.model import ImportedLight
from engine.scene.punctual_lights import LAMP_RADIUS, lamps_of, suns_of

Float64Array = NDArray[np.float64]

MODES = ("placement", "orbit", "deform", "paths")
ALBEDO, HEIGHT, SIZE = 0.5, 1.5, (48, 36)
AWAY, FOV = 100.0, 1.0  # of the camera, metres and degrees
STRENGTH, PLACE = (10.0, 20.0, 30.0), (0.3, HEIGHT, 0.2)


def _aimed(inner: float, outer: float, x: float = 0.2) -> ImportedLight:
    axis = np.array([x, -1.0, -0.1])
    x, y, z = (axis / np.linalg.norm(axis)).tolist()
    return ImportedLight("light", "spot", STRENGTH, PLACE, (x, y, z), math.radians(inner), math.radians(outer))


LIGHTS = {
    "point": ImportedLight("light", "point", STRENGTH, PLACE),
    "spot, 0° to 45°": _aimed(0.0, 45.0),
    "spot, 15° to 35°": _aimed(15.0, 35.0),
    "spot, 24° to 25°": _aimed(24.0, 25.0),
    "directional": ImportedLight("light", "directional", STRENGTH, direction=(-0.35, -0.9, -0.26)),
}


class LightError(NamedTuple):
    """relRMSE of a picture of the floor, and the relative error of its mean."""

    error: float
    mean: float


def measure_light(
    light: ImportedLight, mode: str, folder: Path, size: tuple[int, int] = SIZE, samples: int = 1024
) -> LightError:
    """The error of a picture (width, height) by a mode, of paths with so many samples a pixel."""
    path = folder / "scene.toml"
    path.write_text(_scene_text(light, size))
    scene = insitu.open(path)
    picture = scene.image(mode, samples=samples) if mode == "paths" else scene.image(mode)  # type: ignore[arg-type]
    expected = _expected(light, size)[is_floor := _shows_floor(light, size)]
    off = np.asarray(picture, np.float64)[is_floor] - expected
    return LightError(float(np.sqrt(np.mean(off**2)) / expected.mean()), float(off.mean() / expected.mean()))


def _scene_text(light: ImportedLight, size: tuple[int, int]) -> str:
    lines = [
        "version = 1", "bounces = 1", "[camera]", f"position = [0, {AWAY}, 0]", "target = [0, 0, 0]",
        "up = [0, 0, -1]", f"fov_y = {FOV}", f"resolution = {list(size)}", "[environment]", "radiance = 0",
    ]  # fmt: skip
    for sun in suns_of([light], np.eye(4)):
        lines.append(f"sun = [{{ direction = {list(sun.direction)}, irradiance = {list(sun.irradiance)} }}]")
    for lamp in lamps_of([light], np.eye(4), np.zeros(3), 1.0)[0]:
        lines += _object("light", str(lamp.primitive), lamp.transform, f"emission = {list(lamp.emission or ())}")
        if lamp.cone is not None:
            lines.append(f"cone = {{ inner = {lamp.cone.inner}, outer = {lamp.cone.outer} }}")
    flat = (4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 4.0, 0.0, 0.0, -4.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0)
    lines += _object("floor", "quad", flat, f'layer = [{{ model = "lambert", albedo = {ALBEDO} }}]')
    return "\n".join(lines) + "\n"


def _object(name: str, primitive: str, transform: Sequence[float], more: str) -> list[str]:
    return ["[[object]]", f'name = "{name}"', f'primitive = "{primitive}"', f"transform = {list(transform)}", more]


def _places(size: tuple[int, int]) -> tuple[Float64Array, Float64Array]:
    """x and z (H, W) on the floor at the pixels' centres."""
    width, height = size
    half = AWAY * math.tan(math.radians(FOV) / 2.0)
    across = half * width / height * ((2.0 * np.arange(width) + 1.0) / width - 1.0)
    x, z = np.meshgrid(across, half * ((2.0 * np.arange(height) + 1.0) / height - 1.0))
    return x, z


def _shows_floor(light: ImportedLight, size: tuple[int, int]) -> NDArray[np.bool_]:
    """The pixels (H, W) in which the lamp is not seen."""
    x, z = _places(size)
    if light.kind == "directional":
        return np.ones(x.shape, bool)
    reach = 2.0 * LAMP_RADIUS * max(math.hypot(*light.position), 1.0) + 2.0 * abs(x[0, 1] - x[0, 0])
    return np.asarray(np.hypot(x - light.position[0], z - light.position[2]) > reach)


def _expected(light: ImportedLight, size: tuple[int, int]) -> Float64Array:
    """Radiance (H, W, 3) at the pixels' centres."""
    x, z = _places(size)
    if light.kind == "directional":
        cosine = -light.direction[1] / math.hypot(*light.direction)
        shape = np.full(x.shape, cosine)
    else:
        to = np.subtract(light.position, np.stack([x, np.zeros_like(x), z], axis=2))
        distance = np.linalg.norm(to, axis=2)
        shape = to[..., 1] / distance**3
        if light.kind == "spot":
            edge = max(math.cos(light.inner) - math.cos(light.outer), 1e-3)
            leaves = -np.einsum("hwi,i->hw", to, light.direction) / distance
            shape = shape * np.clip((leaves - math.cos(light.outer)) / edge, 0.0, 1.0) ** 2
    return ALBEDO / math.pi * shape[..., None] * np.array(light.intensity)


def main() -> None:
    """Print the table."""
    print(f"| relRMSE, mean error | {' | '.join(MODES)} |")
    print("| --- " * (len(MODES) + 1) + "|")
    with tempfile.TemporaryDirectory() as folder:
        for name, light in LIGHTS.items():
            found = [measure_light(light, mode, Path(folder)) for mode in MODES]
            cells = [f"{100.0 * each.error:.2g} %, {100.0 * each.mean:+.2f} %" for each in found]
            print(f"| {name} | {' | '.join(cells)} |", flush=True)


if __name__ == "__main__":
    main()
