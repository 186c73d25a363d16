"""Compiles the kernels that a scene needs some time after its first picture, in a process that has nothing else to do:
the worker's own tasks run on a few pixels, so that each kernel gets exactly the types it will be called with."""

from __future__ import annotations

import shutil
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np
from PIL import Image

from app.document.described import document_from_description
from app.document.document import Document
from app.document.scene_state import LayerState, SceneState, layer_state, scene_state
from app.messages.worker_messages import OpenScene, Request, RequestFailed, SetCamera
from app.modes.deform.deform_messages import DrawDeform, PathPreview, PrepareDeform
from app.modes.orbit.orbit_messages import DrawOrbit, PrepareOrbit
from app.modes.placement.placement_messages import (
    ComputeTransport,
    EstimateError,
    FreezeIndirect,
    PrepareRelighting,
    SampleMaps,
)
from app.modes.registry import DEFORM as DEFORM_MODE
from app.modes.registry import MODES
from app.worker.cache import ArrayCache
from app.worker.deform_worker import DeformWorker
from app.worker.kernels import DEFORM, ESTIMATE, INDIRECT, ORBIT, PAINTING, RELIGHTING
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.core.generators import run_to_end
from engine.light.environment import Environment
from engine.light.painted_lights import PaintedLight
from engine.light.painting import painted_environment
from engine.material.layer_maps import Images
from engine.material.strokes import Stroke, Strokes, pack_dabs
from engine.planner import band_counts
from engine.realtime.core.gpu_parts import NO_PARTS
from engine.realtime.zonal_harmonics.pose import Deformation, Moment
from engine.realtime.zonal_harmonics.wrinkle import wrinkles
from engine.scene.builtin import ASSETS
from engine.scene.description import SceneDescription, parse_description
from engine.scene.surface_kinds import DeformSurface, Detail, Membrane, Subsurface
from engine.scene.toml_text import parse_toml
from engine.scene.transform import Transform
from engine.settings import RenderSettings

_SCENE = """version = 1
name = "warm-up"
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
# Besides those of the ball, whose shadow has an edge that requires directional lights split from the environment.
_N_POINTS = 100
# What else Orbit reads: an image, bumps, a sky with directional lights split from it, a brushed layer.
_SKY_CHANGE = (("radiance = 0.5", 'file = "sky.exr"'),)
_ORBIT_CHANGES = (
    *_SKY_CHANGE,
    ('{ model = "rough_conductor", alpha = 0.2 }', '{ model = "ward_anisotropic" }, { model = "rough_conductor" }'),
    (
        'layer = [{ model = "lambert" }]\n[[object]]\nname = "lamp"',
        'bump_map = { file = "relief.png" }\nlayer = [{ model = "lambert", texture = "relief.png" }, '
        '{ model = "rough_conductor", weight = "relief.png" }]\n[[object]]\nname = "lamp"',
    ),
)

_RING_SCALE = 60.0  # fills the picture
_CONCAVE_CHANGES = (
    (
        'primitive = "sphere"',
        f'mesh = "ring.ply"\ntransform = [{_RING_SCALE},0,0,0, 0,{_RING_SCALE},0,0, 0,0,{_RING_SCALE},0, 0,0,0,1]',
    ),
)
# Few vertices, each of which has its own transfer, and an animation.
_DEFORM_CHANGES = (
    ('primitive = "sphere"', 'primitive = "cube"'),
    ('[[object]]\nname = "lamp"', '[[object]]\nname = "bat"\nmesh = "bat.glb"\npart = 0\n[[object]]\nname = "lamp"'),
)
_POSES = (
    ("ball", (Deformation("bend", 40.0),)),
    ("bat", (Moment("flap", 0.3), Deformation("twist", 40.0))),
)
_SURFACES = (
    DeformSurface(),
    DeformSurface(membrane=Membrane()),
    DeformSurface(subsurface=Subsurface(scattering=10.0)),
    DeformSurface(patch=Detail(file="patch.png")),
)
_N_TEXELS = 8  # per side of the patch


_FILES = (
    ("sky.exr", "rings/studio.exr"), ("relief.png", "rings/relief.png"), ("bat.glb", "bat/bat.glb"),
    ("ring.ply", "ring/ring.ply"),
)  # fmt: skip


class SmallDeform(DeformWorker):
    """Deform of few points and rays, and a single pass of paths."""

    n_points, n_rays, n_passes = 60, 16, 1


def warm_up_later(first: str = "", is_done: Callable[[str], bool] = lambda what: False) -> Iterator[str]:
    """Compile all, `first` (Orbit or Deform) before the others, of these the quickest first; yields each of
    `kernels.LATER` when it is compiled. A mode that `is_done` already, by another process, is left out."""
    if first == DEFORM:
        warm_up_deform()
        yield DEFORM
    with tempfile.TemporaryDirectory() as folder:
        scene = Path(folder, "scene.toml")
        scene.write_text(_SCENE)
        client = InProcessClient(RequestDispatcher(ArrayCache(Path(folder, "cache"))))
        if first == ORBIT:
            _warm_up_orbit(client, Path(folder))
            yield ORBIT
        _ask(client, OpenScene(str(scene), id=1))
        _ask(client, SetCamera(1))
        stroke = Stroke(0.5, dabs=pack_dabs([[0.0, 0.0, 0.5]], [[0.0, 0.0, 1.0]]))
        _ask(client, SampleMaps((("ball.0", Images(strokes=Strokes((stroke,)))),)))
        sky = Environment(np.ones((4, 8, 3), np.float32), "warm-up")
        painted_environment(sky, (PaintedLight("box"), PaintedLight("disc", "disc", "cover")), 10.0)
        yield PAINTING
        description = parse_description(parse_toml(_SCENE, scene.name), scene.name)
        state = scene_state(document_from_description(str(scene), description), _with_bands)
        # A preview, and a final picture.
        _ask(client, ComputeTransport(state, "ball.1", "theta_h", 50, RenderSettings(100, 64, 3)))
        _ask(client, FreezeIndirect(state, "ball.1", 0))
        _ask(client, FreezeIndirect(state))
        _freeze_concave(Path(folder))
        yield INDIRECT
        _ask(client, EstimateError(state))
        yield ESTIMATE
        _relight_concave(Path(folder))
        _move_ball_and_lamp(client, state)
        yield RELIGHTING
        if first != ORBIT and not is_done(ORBIT):
            _warm_up_orbit(client, Path(folder))
            yield ORBIT
    if first != DEFORM and not is_done(DEFORM):
        warm_up_deform()
        yield DEFORM


def _move_ball_and_lamp(client: InProcessClient, state: SceneState) -> None:
    """Drag the lamp over the open scene, then put the ball elsewhere."""
    moved = (Transform((0.1, 0.0, 0.1)),)
    transport = ComputeTransport(state, "ball.1", "theta_h", 50, RenderSettings(100, 64, 3))
    dragged = replace(state, lamps=(("lamp", moved),))
    _ask(client, replace(transport, scene=dragged, is_drag=True))
    _ask(client, SetCamera(1, poses=(("ball", moved),)))
    _ask(client, transport)


def _freeze_concave(folder: Path) -> None:
    """Freeze a ring that lights itself."""
    client, state = _lit_ring(folder, ())
    _ask(client, FreezeIndirect(state, "ball.1", 0))


def _relight_concave(folder: Path) -> None:
    """Turn the sky over such a ring."""
    client, state = _lit_ring(folder, _SKY_CHANGE)
    _ask(client, FreezeIndirect(state))
    _ask(client, PrepareRelighting(state))
    turned = replace(state, light=replace(state.light, rotation=90.0))
    _ask(client, ComputeTransport(turned, "ball.1", "theta_h", 50, RenderSettings(100, 64), is_drag=True))


def _lit_ring(folder: Path, changes: tuple[tuple[str, str], ...]) -> tuple[InProcessClient, SceneState]:
    """The picture of the ring after three bounces, which samples the whole sphere, as relighting requires."""
    client = InProcessClient(RequestDispatcher(ArrayCache(folder / f"cache of {len(changes)} changes")))
    _, state = _opened(client, folder, (*_CONCAVE_CHANGES, *changes), _with_bands)
    _ask(client, ComputeTransport(state, "ball.1", "theta_h", 50, RenderSettings(100, 64, 3)))
    return client, state


def _warm_up_orbit(client: InProcessClient, folder: Path) -> None:
    description, state = _opened(client, folder, _ORBIT_CHANGES)
    _ask(client, PrepareOrbit(state, 3, n_points=_N_POINTS))
    for quality in ("moving", "rest"):
        _ask(client, DrawOrbit(description.camera, (24, 24), quality))  # type: ignore[arg-type]
    moved = tuple((name, (Transform((0.1, 0.0, 0.0)),)) for name in ("ball", "lamp"))
    _ask(client, PrepareOrbit(state, 3, n_points=_N_POINTS, poses=moved))


def warm_up_deform() -> None:
    """Compile what Deform needs, by a worker's tasks on few points."""
    modes = [
        replace(mode, worker="app.worker.kernel_warm_up:SmallDeform") if mode is DEFORM_MODE else mode for mode in MODES
    ]
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        _draw_bent(InProcessClient(RequestDispatcher(ArrayCache(folder / "cache"), modes=modes)), folder)


def _draw_bent(client: InProcessClient, folder: Path) -> None:
    """Draw a small scene with each kind of surface, in each kind of picture."""
    description, state = _opened(client, folder, (*_ORBIT_CHANGES, *_DEFORM_CHANGES))
    camera, size = description.camera, (24, 24)
    posed = tuple(name for name, _ in _POSES)
    Image.new("L", (_N_TEXELS, _N_TEXELS), 128).save(folder / "patch.png")
    for surface in _SURFACES:
        _ask(client, PrepareDeform(state, 3, posed, (("ground", surface),)))
        _ask(client, DrawDeform(camera, size, "moving", _POSES))
        _ask(client, DrawDeform(camera, size, "moving", _POSES, sent_parts=NO_PARTS))
        _ask(client, DrawDeform(camera, size, "rest", _POSES))
    _ask(client, DrawDeform(camera, size, "moving", _POSES, fit_error=True))
    _ask(client, PrepareDeform(state, 3, posed, traced=PathPreview(camera, (4, 4), _POSES)))
    _ask(client, DrawDeform(camera, size, "moving", _POSES, split=(0.3, 0.6)))
    run_to_end(wrinkles(side=2))  # those of a real scene are fitted for half a minute


def _opened(
    client: InProcessClient,
    folder: Path,
    changes: tuple[tuple[str, str], ...],
    layer: Callable[[Document, str], LayerState] = layer_state,
) -> tuple[SceneDescription, SceneState]:
    """The opened scene, with other text in some places and the files that this names."""
    text = _SCENE
    for before, after in changes:
        text = text.replace(before, after)
    for name, of in _FILES:
        shutil.copy(ASSETS / "scenes" / of, folder / name)
    scene = folder / "changed.toml"
    scene.write_text(text)
    _ask(client, OpenScene(str(scene), id=1))
    _ask(client, SetCamera(1))
    description = parse_description(parse_toml(text, scene.name), scene.name)
    return description, scene_state(document_from_description(str(scene), description), layer)


def _with_bands(document: Document, key: str) -> LayerState:
    return layer_state(document, key, tuple(band_counts(document.layer(key)).values()))


def _ask(client: InProcessClient, request: Request) -> None:
    """Have a request carried out. Raises RuntimeError where that fails: then not all is compiled."""
    client.send(request)
    while client.wait(0.0):
        for answer in client.poll():
            if isinstance(answer, RequestFailed):
                raise RuntimeError(answer.line)
