"""What a scene first wants some time after its first picture, compiled by a process that has nothing else to do: the
worker's own tasks carried out on a few pixels, so that each kernel gets exactly the types it will be called with."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

from app.document import Document, document_from_description
from app.jobs.cache import Store
from app.jobs.in_process import InProcessClient
from app.jobs.kernels import ESTIMATE, INDIRECT, ORBIT, PAINTING, RELIGHTING
from app.jobs.tasks import Tasks
from app.messages import Failed, LookFrom, OpenScene, Request
from app.orbit.messages import DrawOrbit, PrepareOrbit
from app.placement.messages import ComputeTransport, EstimateError, Freeze, PrepareRelighting, SampleMaps
from app.scene_state import LayerState, layer_state, scene_state
from engine.material.maps import Images
from engine.material.strokes import Stroke, Strokes, pack_dabs
from engine.plan import Decisions, band_counts
from engine.scene.builtin import scene_path
from engine.scene.description import parse_description
from engine.scene.toml_text import parse_toml

_SCENE = """version = 1
name = "rehearsal"
bounces = 3
[camera]
position = [0, 1, 3]
target = [0, 0, 0]
resolution = [8, 8]
[environment]
radiance = 0.5
[[object]]
name = "ball"
primitive = "sphere"
layer = [{ model = "lambert" }, { model = "rough_conductor", alpha = 0.2 }]
[[object]]
name = "ground"
primitive = "quad"
transform = [5,0,0,0, 0,0,5,-0.5, 0,-5,0,0, 0,0,0,1]
layer = [{ model = "lambert" }]
[[object]]
name = "lamp"
primitive = "quad"
transform = [1,0,0,0, 0,0,-1,2, 0,1,0,0, 0,0,0,1]
emission = [5, 5, 5]
"""
# Beside those of the ball, whose shadow has an edge that asks for suns.
_N_POINTS = 100
# What Orbit reads besides: an image, bumps, and a sky with suns, a brushed layer.
_ORBIT_CHANGES = (
    ("radiance = 0.5", 'file = "sky.exr"'),
    ('{ model = "rough_conductor", alpha = 0.2 }', '{ model = "ward_anisotropic" }, { model = "rough_conductor" }'),
    (
        'layer = [{ model = "lambert" }]\n[[object]]\nname = "lamp"',
        'bump_map = { file = "relief.png" }\nlayer = [{ model = "lambert", texture = "relief.png" }, '
        '{ model = "rough_conductor", weight = "relief.png" }]\n[[object]]\nname = "lamp"',
    ),
)


def rehearse_later() -> Iterator[str]:
    """Go through them, the quickest first; yields each of `kernels.LATER` when it is compiled."""
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "scene.toml")
        scene.write_text(_SCENE)
        client = InProcessClient(Tasks(Store(Path(folder, "cache"))))
        _ask(client, OpenScene(str(scene), id=1))
        _ask(client, LookFrom(1))
        stroke = Stroke(0.5, dabs=pack_dabs([[0.0, 0.0, 0.5]], [[0.0, 0.0, 1.0]]))
        _ask(client, SampleMaps((("ball.0", Images(strokes=Strokes((stroke,)))),)))
        yield PAINTING
        description = parse_description(parse_toml(_SCENE, scene.name), scene.name)
        state = scene_state(document_from_description(str(scene), description), _with_bands)
        # A preview, and a final picture that sees the whole sphere, without which there is nothing to light anew.
        _ask(client, ComputeTransport(state, "ball.1", "theta_h", 50, Decisions(100, 64, 3)))
        _ask(client, Freeze(state, "ball.1", 0))
        _ask(client, Freeze(state))
        yield INDIRECT
        _ask(client, EstimateError(state))
        yield ESTIMATE
        _ask(client, PrepareRelighting(state))
        turned = replace(state, light=replace(state.light, rotation=90.0))
        _ask(client, ComputeTransport(turned, "ball.1", "theta_h", 50, Decisions(100, 64), is_drag=True))
        yield RELIGHTING
        _rehearse_orbit(client, Path(folder))
        yield ORBIT


def _rehearse_orbit(client: InProcessClient, folder: Path) -> None:
    text = _SCENE
    for before, after in _ORBIT_CHANGES:
        text = text.replace(before, after)
    for name in ("sky.exr", "relief.png"):
        shutil.copy(scene_path("rings").parent / {"sky.exr": "studio.exr"}.get(name, name), folder / name)
    scene = folder / "orbit.toml"
    scene.write_text(text)
    _ask(client, OpenScene(str(scene), id=1))
    _ask(client, LookFrom(1))
    description = parse_description(parse_toml(text, scene.name), scene.name)
    state = scene_state(document_from_description(str(scene), description))
    _ask(client, PrepareOrbit(state, 3, n_points=_N_POINTS))
    for quality in ("moving", "rest"):
        _ask(client, DrawOrbit(description.camera, (24, 24), quality))  # type: ignore[arg-type]


def _with_bands(document: Document, key: str) -> LayerState:
    return layer_state(document, key, tuple(band_counts(document.layer(key)).values()))


def _ask(client: InProcessClient, request: Request) -> None:
    """Have a request carried out. Raises RuntimeError where it cannot be: then not all is compiled."""
    client.send(request)
    while client.wait(0.0):
        for answer in client.poll():
            if isinstance(answer, Failed):
                raise RuntimeError(answer.line)
