"""Orbit and Deform, led through edits and back, draw what they draw of the same wishes afresh: nothing of what was
wanted meanwhile is left in the picture. Placement's walk goes through an editor, see tests/ui/test_same_document.py.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest

from engine.light.environment import Environment
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.zonal_harmonics.deform_engine import Deform
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.scene.scene_loader import Scene, load_scene
from engine.scene.surface_kinds import DeformSurface, Subsurface
from tests.scene_text import camera, environment, facing_up, placed

SIZE = (48, 36)
MATT = make_layer(MODELS["lambert"], {"albedo": (0.6, 0.5, 0.4)})
WHITE = make_layer(MODELS["lambert"], {"albedo": (0.9, 0.9, 0.9)})
GLOSS, SOFT = (make_layer(MODELS["rough_conductor"], {"alpha": alpha}) for alpha in (0.15, 0.5))
LAYERS = ((MATT,), (WHITE,), (GLOSS,), (SOFT,), (MATT, SOFT))
ALABASTER = DeformSurface(subsurface=Subsurface(scattering=4.0))
BENT = (("box", (Deformation("bend", 40.0),)),)


@dataclass(frozen=True)
class Wish:
    """What a document asks of either mode; the camera is none of its."""

    rotation: float = 30.0
    box: int = 0
    floor: int = 1
    n_bounces: int = 2
    lamp: float = 4.0
    alabaster: bool = False
    posed: bool = True
    effort: tuple[int, int, int | None] = (64, 2, None)


@pytest.fixture(scope="module")
def scene(tmp_path_factory: pytest.TempPathFactory) -> Scene:
    path = Path(tmp_path_factory.mktemp("scene")) / "two.toml"
    path.write_text(
        camera((1.5, 1.2, 3.0), 40, SIZE, (0.3, 0, 0))
        + environment()
        + placed("box", "cube")
        + placed("floor", "quad", facing_up(3, (0, -0.5, 0)))
        + placed("lamp", "quad", "0.5,0,0,0, 0,0,0.5,2, 0,0.5,0,0, 0,0,0,1", "emission = [4, 4, 4]\n")
        + placed("card", "quad", "0,0,-0.15,-0.8, 0,0.15,0,-0.1, 0.15,0,0,0, 0,0,0,1")  # its back to the box
    )
    return load_scene(path)


def sky(rotation: float) -> SkyState:
    image = np.random.default_rng(2).uniform(0.0, 2.0, (16, 32, 3)).astype(np.float32)
    return SkyState(Environment(image, "noise"), rotation)


def tell(mode: Orbit | Deform, wish: Wish) -> None:
    mode.set_light(sky(wish.rotation))
    mode.set_layers({0: LAYERS[wish.box], 1: LAYERS[wish.floor], 3: (WHITE,)})
    mode.set_bounces(wish.n_bounces)
    mode.set_emission({"lamp": (wish.lamp,) * 3})
    if isinstance(mode, Deform):
        mode.set_surfaces((("box", ALABASTER),) if wish.alabaster else ())
        mode.set_bending(["box"] if wish.posed else [])
        mode.set_effort(*wish.effort)


def drawn(mode: Orbit | Deform, wish: Wish, scene: Scene) -> np.ndarray:
    """The picture at rest, once all that it asks for is there."""
    tell(mode, wish)
    for _ in range(3):  # a picture may see what nothing was made ready for
        for _ in mode.work():
            pass
        picture = _draw(mode, wish, scene)
    return picture


def _draw(mode: Orbit | Deform, wish: Wish, scene: Scene) -> np.ndarray:
    seen = scene.description.camera
    return mode.draw(seen, SIZE, BENT if wish.posed else ()) if isinstance(mode, Deform) else mode.draw(seen, SIZE)


def led_about(mode: Orbit | Deform, wish: Wish, random: np.random.Generator, n: int) -> Wish:
    """Edits, each given up after some of the work for it."""
    values = {
        "rotation": (30.0, 77.0, 200.0), "box": range(5), "floor": range(5), "n_bounces": (0, 1, 2, 4),
        "lamp": (0.0, 4.0, 9.0), "alabaster": (False, True), "posed": (False, True),
        "effort": ((64, 2, None), (128, 1, 0), (64, 2, 6)),
    }  # fmt: skip
    for _ in range(n):
        if isinstance(mode, Orbit) and mode.is_ready and random.random() < 0.4:
            look_about(mode, random)
        name = str(random.choice(sorted(values)))
        wish = replace(wish, **{name: values[name][int(random.integers(len(values[name])))]})
        tell(mode, wish)
        for _, _step in zip(range(int(random.choice([0, 2, 10, 200]))), mode.work(), strict=False):
            pass
    return wish


def look_about(orbit: Orbit, random: np.random.Generator) -> None:
    """Pictures from anywhere, from below the floor too; each object that is seen from behind gets points there."""
    seen = orbit.scene.description.camera.model_copy(update={"position": tuple(random.uniform(-3.0, 3.0, 3).tolist())})
    orbit.draw(seen, SIZE, str(random.choice(["moving", "rest"])))


MAKERS: dict[str, Callable[[Scene], Orbit | Deform]] = {
    "orbit": lambda scene: Orbit(scene, n_points=500, n_coefficients=64),
    "deform": lambda scene: Deform(scene, n_points=300, n_rays=64),
}


@pytest.mark.parametrize("seed", [0, *(pytest.param(seed, marks=pytest.mark.sweep) for seed in range(1, 31))])
@pytest.mark.parametrize("mode", MAKERS)
def test_edits_that_are_undone_leave_no_trace(scene: Scene, mode: str, seed: int) -> None:
    random, made, first = np.random.default_rng(seed), MAKERS[mode](scene), Wish()
    before = drawn(made, first, scene)
    last = led_about(made, first, random, 6 if seed == 0 else 15)
    np.testing.assert_allclose(drawn(made, last, scene), drawn(MAKERS[mode](scene), last, scene), rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(drawn(made, first, scene), before, rtol=1e-5, atol=1e-6)
    if isinstance(made, Orbit):  # another window finds in the cache what this one has seen
        other = MAKERS[mode](scene)
        other.restore(made.stored_visibility())
        np.testing.assert_allclose(drawn(other, first, scene), before, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("box", [0, 2])
def test_backs_that_a_camera_has_seen_light_nothing(scene: Scene, box: int) -> None:
    """The back of a card beside the box was in the light that bounces, and in mirrors, once a camera had seen it."""
    wish, own = Wish(box=box, floor=2, n_bounces=4), scene.description.camera
    behind = [
        own.model_copy(update={"position": (1.5, -1.8, 3.0)}),
        own.model_copy(update={"position": (-0.2, 0.9, 1.2), "target": (-0.8, -0.1, 0.0)}),
    ]
    made, other = MAKERS["orbit"](scene), MAKERS["orbit"](scene)
    first = drawn(made, wish, scene)
    tell(other, wish)
    for orbit, cameras in ((made, behind), (other, behind[::-1])):
        for _ in orbit.work():
            pass
        for seen in 2 * cameras:
            orbit.draw(seen, SIZE)
            for _ in orbit.work():
                pass
        assert orbit.lit is not None and set(orbit.lit.late) == {-1, 1, 3}  # the floor and the card
    for seen in behind:
        from_behind = made.draw(seen, SIZE)
        np.testing.assert_allclose(from_behind, other.draw(seen, SIZE), rtol=1e-5, atol=1e-6)
        assert (from_behind.max(axis=2) > 0.0).mean() > 0.9
    for orbit in (made, other):
        np.testing.assert_allclose(drawn(orbit, wish, scene), first, rtol=1e-5, atol=1e-6)
