"""What a mix of lights costs in Placement once pictures of each light are there, and its error.

The error is that of direct light: a mix by the worker's weighted sum against the final transport of that very light, in
a scene of eight lights. Each of both has an error of its own against brute force (`oracle_error`), so that a part of
the difference is not added by the mix. Times are of made-up pictures of 512 x 512 pixels, whose numbers do not matter.
"""

from __future__ import annotations

import tempfile
import time
from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from app.document.light_state import ENVIRONMENT_KEY, MixRow
from app.document.scene_state import SceneState
from app.modes.placement.placement_messages import PrepareRelighting
from benchmarks.figures import Figure, NotMeasured, not_measured
from benchmarks.relighting import Pictures, ReadyScene, RelightEffort
from engine.core.weighted_sum import ChangingSum
from engine.precompute.direct.pipeline import FINAL
from engine.render.picture_difference import errors
from engine.scene.picture_frame import PictureFrame

NAMES = ("mix_ms_8", "mix_ms_64", "mix_error")
N_LAMPS = 7
TIMES_TEN = 10.0
_N_FIRST = 3  # frames that compile shaders, and find which lights change and whether by one factor


@dataclass(frozen=True)
class MixEffort:
    """The picture of the error and its lights, the side of that of the times, and frames timed."""

    resolution: tuple[int, int] = (96, 72)
    n_final: int = FINAL.n_lights
    side: int = 512
    n_frames: int = 20


def mix_figures(effort: MixEffort | None, report: Callable[[str], None]) -> list[Figure]:
    """All of them; None: left out."""
    if effort is None:
        return [not_measured(name, "left out of a quick run") for name in NAMES]
    report("a mix of lights in Placement")
    figures = []
    for n_lights in (8, 64):
        name, how = f"mix_ms_{n_lights}", f"{effort.side} x {effort.side} pixels"
        try:
            frames = _frame_ms(n_lights, n_lights, effort)
            parts = {
                "one light changes": float(np.median(_frame_ms(n_lights, 1, effort))),
                "one group of all lights changes": float(np.median(_frame_ms(n_lights, n_lights, effort, True))),
            }
        except NotMeasured as error:
            figures.append(not_measured(name, str(error)))
            continue
        how = f"{how}, all of {n_lights} lights change: weighted sum, upload, shading, view (glFinish)"
        figures.append(Figure(name, frames, how, parts))
    with tempfile.TemporaryDirectory(prefix="insitu-measure-") as folder:
        off = _errors(effort, Path(folder))
    how = "{}x{}".format(*effort.resolution) + f", {N_LAMPS} lamps and a sky, one light times ten or alone"
    return [*figures, Figure("mix_error", tuple(off.values()), f"{how}, against that light's own transport", off)]


def _errors(effort: MixEffort, folder: Path) -> dict[str, float]:
    """relRMSE of mixes, by name."""
    (folder / "scene.toml").write_text(scene_text())
    ready = ReadyScene(str(folder / "scene.toml"), RelightEffort(effort.resolution, n_final=effort.n_final), folder)
    ready.ask(PrepareRelighting(ready.scene))
    found: dict[str, tuple[SceneState, Pictures]] = {}
    for light in ("sky", "lamp 0", f"lamp {N_LAMPS - 1}"):
        for name, others, factor in ((f"{light} x 10", 1.0, TIMES_TEN), (f"{light} alone", 0.0, 1.0)):
            scene = mixed_scene(ready.scene, light, others, factor)
            found[name] = scene, ready.pictures(ready.transport(scene), "relit")
    off = {}
    for name, (scene, mixed) in found.items():
        truth = ready.pictures(ready.transport(scene, effort.n_final), "final")
        both = (np.concatenate([each[key] for key in truth]) for each in (mixed, truth))
        off[name] = errors(*both).rmse
    return off


def mixed_scene(scene: SceneState, light: str, others: float, factor: float) -> SceneState:
    """A scene with one light times a factor, and others times another."""

    def gain(name: str) -> float:
        return factor if name == light else others

    emission = tuple((name, (gain(name) * r, gain(name) * g, gain(name) * b)) for name, (r, g, b) in scene.emission)
    sky = gain("sky")
    row = MixRow(colour=(sky, sky, sky))
    return replace(scene, light=scene.light.with_row(ENVIRONMENT_KEY, row), emission=emission)


def scene_text() -> str:
    """Two balls on a table under a sky and lamps in a ring, of several colours and strengths."""
    text = """version = 1
[camera]
position = [0.4, 1.6, 2.6]
target = [0, 0.3, 0]
fov_y = 45
[environment]
radiance = [0.3, 0.4, 0.6]
[[object]]
name = "table"
primitive = "quad"
transform = [6, 0, 0, 0, 0, 0, 6, 0, 0, -6, 0, 0, 0, 0, 0, 1]
layer = [{ model = "lambert" }]
"""
    for name, x, model in (("matt", -0.5, "lambert"), ("metal", 0.5, "rough_conductor")):
        text += f'[[object]]\nname = "{name}"\nprimitive = "sphere"\nlayer = [{{ model = "{model}" }}]\n'
        text += f"transform = [0.8, 0, 0, {x}, 0, 0.8, 0, 0.4, 0, 0, 0.8, 0, 0, 0, 0, 1]\n"
    for i in range(N_LAMPS):
        angle = 2.0 * np.pi * i / N_LAMPS
        x, z = 1.6 * np.cos(angle), 1.6 * np.sin(angle)
        emission = [2.0 ** (i % 4), 3.0, 2.0 ** ((i + 2) % 4)]
        text += f'[[object]]\nname = "lamp {i}"\nprimitive = "quad"\nemission = {emission}\n'
        text += f"transform = [0.3, 0, 0, {x:.3f}, 0, 0, -0.3, 1.9, 0, 0.3, 0, {z:.3f}, 0, 0, 0, 1]\n"
    return text


def _frame_ms(n_lights: int, n_changing: int, effort: MixEffort, is_group: bool = False) -> tuple[float, ...]:
    """Milliseconds from weights to a finished frame while so many lights change, by one factor where they are a group.
    Raises NotMeasured where there is no OpenGL."""
    from ui.gl.context import GraphicsError, create_headless_context
    from ui.gl.display import DisplayView
    from ui.modes.placement.gl.renderer import PlacementRenderer

    try:
        context = create_headless_context()
    except GraphicsError as error:
        raise NotMeasured(str(error)) from None
    random, n_points = np.random.default_rng(8), effort.side**2
    pictures = [random.random((n_points, 3), np.float32) for _ in range(n_lights)]
    mix, weights = ChangingSum[int](pictures.__getitem__, n_points), dict.fromkeys(range(n_lights), (1.0, 1.0, 1.0))
    renderer = PlacementRenderer(context)
    renderer.set_frame(_whole_frame(effort.side))
    renderer.set_layer("wall.0", 0, n_points)
    milliseconds = []
    for _ in range(effort.n_frames + _N_FIRST):
        changed = random.random((1 if is_group else n_changing, 3)).tolist()
        for i in range(n_changing):
            red, green, blue = changed[i % len(changed)]
            weights[i] = red, green, blue
        begun = time.perf_counter()
        renderer.set_layer_radiance("wall.0", mix.at(weights))
        renderer.composite(DisplayView())
        context.finish()
        milliseconds.append(1e3 * (time.perf_counter() - begun))
    renderer.release()
    context.release()
    return tuple(milliseconds[_N_FIRST:])


def _whole_frame(side: int) -> PictureFrame:
    """A picture all of which is one object."""
    rays = np.tile(np.array((0.0, 0.0, -1.0), np.float32), (side, side, 1))
    return PictureFrame(
        pixel=np.arange(side**2, dtype=np.int32), object_ranges=np.array([[0, side**2]], np.int32),
        object_image=np.zeros((side, side), np.int16), emission_image=np.zeros((side, side, 3), np.float32),
        ray_directions=rays, theta_o=np.zeros(side**2, np.float32),
    )  # fmt: skip
