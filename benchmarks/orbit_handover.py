"""How much Orbit's resting picture changes when Placement's comes: `python -m benchmarks.orbit_handover [SCENE ...]`.

Means over the picture, of 255 on screen, in direct light and with four bounces; the worst block of 8 × 8 pixels; and
each object's part of the mean.
"""

from __future__ import annotations

import sys
from collections.abc import Iterator

import numpy as np

from app.measure.settings_orbit import finish_orbit
from app.project.project import open_project
from app.stills.stills import layers_by_object, render_picture
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.render.display import display_picture

SCENES, RESOLUTION, BLOCK = ("room", "storeroom"), (192, 144), 8


def changes(name: str, n_bounces: int) -> Iterator[str]:
    """Lines about one scene."""
    project = open_project(name, RESOLUTION)
    scene, layers, (width, height) = project.scene, layers_by_object(project), RESOLUTION
    exact = render_picture(project, lambda step: None, series=BounceSeries(n_bounces))
    orbit = Orbit(scene)
    finish_orbit(orbit, project.sky, layers, n_bounces)
    orbit.draw(scene.description.camera, RESOLUTION)
    finish_orbit(orbit, project.sky, layers, n_bounces)  # backs that this has seen
    own = orbit.draw(scene.description.camera, RESOLUTION)
    change = np.abs(display_picture(own).astype(float) - display_picture(exact)).mean(axis=2)
    blocks = change.reshape(height // BLOCK, BLOCK, width // BLOCK, BLOCK).mean(axis=(1, 3))
    yield f"{name}, bounces {n_bounces}: mean {change.mean():.2f}, worst block {blocks.max():.1f}"
    ids = Placement(scene).hits.object_image
    for i, each in enumerate(scene.object_names):
        yield f"  {each}: {change[ids == i].sum() / change.size:.2f}"


def main() -> None:
    for name in sys.argv[1:] or SCENES:
        for n_bounces in (1, 4):
            print(*changes(name, n_bounces), sep="\n", flush=True)


if __name__ == "__main__":
    main()
