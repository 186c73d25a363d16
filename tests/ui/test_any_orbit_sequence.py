"""Whatever a hand does in Orbit, at whatever stage: no fault, and in the end the picture of what there is.

The worker is the real one with a stand-in for Orbit's engine, whose pictures name all that they are drawn of: so the
last one is known in advance, without another start.
"""

from __future__ import annotations

import hashlib
import inspect
from collections.abc import Callable, Collection, Iterator, Mapping, Sequence
from pathlib import Path

import moderngl
import numpy as np
import pytest

from app.document.commands import SetShadowCatcher
from app.document.commands.plan import override_from_value
from app.document.commands.poses import SetTransform
from app.document.document import Document
from app.document.effective_settings import effective_view
from app.document.view_state import SetView, Viewpoint, ViewState
from app.editor.editor import Editor
from app.modes.orbit.desired_state import DesiredOrbit
from app.modes.orbit.orbit_controller import OrbitController
from app.modes.orbit.orbit_events import OrbitPicture
from app.modes.registry import MODES
from app.project.distant_light import sky_of
from app.project.project import open_project
from app.stills.shadow_catcher import caught_shadows, over_sky
from app.worker.cache import ArrayCache
from engine.core.generators import StillProgress
from engine.material.layer import Layer
from engine.precompute.direct.pipeline import SkyState
from engine.realtime.triple_product.moved_orbit import MovedOrbit
from engine.realtime.triple_product.orbit_engine import Orbit
from engine.realtime.zonal_harmonics.posed_scene import pose_scene
from engine.scene.description import Camera, CameraDescription
from engine.scene.scene_loader import Scene, load_scene
from tests.ui.late_client import LateClient
from tests.ui.small_scene import write_small_scene
from tests.ui.test_any_sequence import COMMANDS as OTHERS
from tests.ui.test_any_sequence import (
    FRAME_SECONDS,
    MAY_BE_TOLD,
    MOST_FRAMES,
    RESOLUTION,
    TOLERANCE,
    find_anew,
    relative_error,
)
from ui.modes.orbit.orbit_feed import OrbitFeed
from ui.modes.placement.placement_feed import PlacementFeed
from ui.picture_feed import PictureFeed

N_STEPS = 5


def colour_of(*parts: object) -> np.ndarray:
    """A colour (3,) that belongs to these values alone."""
    digest = hashlib.blake2b(repr(parts).encode(), digest_size=6).digest()
    return np.frombuffer(digest, "<u2").astype(np.float32) / np.float32(65536.0)


def said_of_layers(layers: Sequence[Layer]) -> list[object]:
    return [(layer.model.name, layer.name, layer.parameters, layer.edits, layer.maps) for layer in layers]


class NamedOrbit:
    """As `engine.realtime.triple_product.orbit_engine.Orbit`; each picture is of one colour, that of all it is drawn
    of, or black while anything of it is still to be made ready. Nothing of it is kept in the cache."""

    n_bytes, n_bounces, has_traced, notes = 1, 1, False, ()

    def __init__(
        self, scene: Scene, caster: object = None, n_points: int = 1, n_coefficients: int = 1, n_patches: int = 1,
        most_bytes: int = 1, most_slice_bytes: int = 1, former: object = None,
    ) -> None:  # fmt: skip
        self.scene, self.version, self.is_ready, self.fraction = scene, 0, False, 0.0
        self._wanted: tuple[object, ...] = ()
        self._light: SkyState | None = None
        self._layers: object = None
        self._effort: tuple[int, ...] = (n_points, n_coefficients)
        self._bounces = 0
        self._left = N_STEPS

    def _begin(self) -> None:
        self._left, self.version = N_STEPS, self.version + 1

    def set_light(self, sky: SkyState) -> None:
        if sky != self._light:
            self._light = sky
            self._begin()

    def set_emission(self, emission: Mapping[str, tuple[float, float, float]]) -> None:
        self.scene = self.scene.with_emission(emission)
        self._begin()

    def set_bumps(self, bumps: object) -> None:
        """No object of the walk has any."""

    def set_layers(self, layers_of: Mapping[int, Sequence[Layer]]) -> None:
        layers = [said_of_layers(own) for _, own in sorted(layers_of.items())]
        if layers != self._layers:
            self._layers = layers
            self._begin()

    def set_bounces(self, n_bounces: int) -> None:
        if n_bounces != self._bounces:
            self._bounces = n_bounces
            self._begin()

    @property
    def is_shadowed(self) -> bool:
        return self.is_ready and self._left < N_STEPS // 2

    @property
    def is_done(self) -> bool:
        return self.is_ready and self._left == 0

    def prioritize_view(self, camera: CameraDescription) -> None:
        """Nothing of it comes first."""

    def work(self) -> Iterator[StillProgress]:
        yield StillProgress(0.0, "points")
        self.is_ready = True
        while self._left:
            self._left, self.version = self._left - 1, self.version + 1
            yield StillProgress(1.0 - self._left / N_STEPS, "work")

    def draw_steps(
        self,
        camera: CameraDescription,
        resolution: tuple[int, int],
        quality: str,
        n_moving: int = 64,
        has_soft_edges: bool = False,
        transparent: bool = False,
        apart: Collection[int] = (),
    ) -> Iterator[StillProgress]:
        assert self.is_ready and self._light is not None
        seen = Camera(**{name: getattr(camera, name) for name in Camera.model_fields})
        wanted = (
            self._light.rotation,
            self._light.scale,
            self._layers,
            self._effort,
            self._bounces,
            places_of(self.scene),
        )
        colour = colour_of(seen, *wanted) * self.is_done
        for _ in range(3 if quality == "rest" else 1):
            yield StillProgress(0.5, "drawing")
        colour = with_parts(colour, transparent, apart)
        return np.broadcast_to(colour, (*resolution[::-1], len(colour))).astype(np.float32)


def with_parts(colour: np.ndarray, transparent: bool, apart: Collection[int]) -> np.ndarray:
    """A colour with alpha, and followed by that of some objects, which are all that is seen of them."""
    colour = np.append(colour, 1.0) if transparent or apart else colour
    return np.tile(colour, 2) if apart else colour


class NamedMovedOrbit:
    """As `engine.realtime.triple_product.moved_orbit.MovedOrbit`: of what follows objects no picture is whole."""

    waits_in_sight = True

    def __init__(self, orbit: NamedOrbit) -> None:
        assert orbit.is_ready
        self.orbit, self._left = orbit, 0

    def move(self, scene: Scene, matrices: Mapping[int, np.ndarray]) -> None:
        assert all(np.linalg.det(matrix) > 0.0 for matrix in matrices.values())
        self.orbit.scene, self._left = scene, 3

    def work(self) -> Iterator[StillProgress]:
        while self._left:
            self._left, self.orbit.version = self._left - 1, self.orbit.version + 1
            yield StillProgress(0.5, "moved objects")
        self.orbit._left = N_STEPS

    @property
    def former_points(self) -> None:
        return None


def places_of(scene: Scene) -> str:
    """Where the objects are."""
    return hashlib.blake2b(scene.vertices.tobytes()).hexdigest()


def assert_called_alike(stand_in: type, engine: type) -> None:
    """Each method that both have takes the same arguments, in the same order, by the same names."""
    shared = [name for name in dir(stand_in) if name == "__init__" or not name.startswith("_")]
    shared = [name for name in shared if inspect.isfunction(getattr(engine, name, None))]
    assert {"__init__", "set_light", "set_layers", "work"} <= set(shared)
    for name in shared:
        assert_called_alike_by(stand_in, engine, name)


def assert_called_alike_by(stand_in: type, engine: type, name: str) -> None:
    taken, expected = (list(inspect.signature(getattr(each, name)).parameters) for each in (stand_in, engine))
    assert taken == expected, name


def test_the_stand_in_is_called_as_the_engine_is() -> None:
    assert_called_alike(NamedOrbit, Orbit)
    for name in ("__init__", "move", "work"):
        assert_called_alike_by(NamedMovedOrbit, MovedOrbit, name)


def expected_colour(editor: Editor, source: str) -> np.ndarray:
    """That of the picture that the document and the view come to."""
    document: Document = editor.document
    view: ViewState = effective_view(editor.view, editor.document)
    wish = DesiredOrbit.of(document, view)
    layers, effort = wish.scene.layers, (wish.n_points, wish.n_coefficients)
    names = [state.name for state in document.objects]
    own = [said_of_layers([each.layer for each in layers if each.object == name]) for name in names]
    scene = load_scene(source)
    sky = sky_of(scene, wish.scene.light)
    seen = editor.camera_history.camera, document.light.rotation, sky.scale
    colour = colour_of(*seen, own, effort, wish.n_bounces, places_of(pose_scene(scene, document.poses)))
    if wish.catchers is None:
        return colour
    alone = open_project(source).edited(wish.catchers.document, Viewpoint()).scene
    layers = wish.catchers.scene.layers
    own = [said_of_layers([each.layer for each in layers if each.object == name]) for name in alone.object_names]
    rest = colour_of(*seen, own, effort, wish.n_bounces, places_of(alone))
    return expected_shadow(editor, colour, rest, sky)


def expected_shadow(editor: Editor, colour: np.ndarray, rest: np.ndarray, sky: SkyState) -> np.ndarray:
    """The corner of a picture whose shadow catchers fill it, as that which has these colours with all and alone."""
    whole, alone = (np.broadcast_to(np.append(each, 1.0), (*RESOLUTION[::-1], 4)) for each in (colour, rest))
    caught = caught_shadows(whole.astype(np.float32), whole.astype(np.float32), alone.astype(np.float32))
    if not editor.document.background.hides_environment:
        caught = over_sky(caught, sky, editor.camera_history.camera)
    return caught[0, 0, :3]


CAMERAS = tuple(Camera(position=(0.3 * i, 1.0, 2.6), target=(0.0, 0.45, 0.0), fov_y=42.0) for i in range(1, 4))


class OrbitWalk:
    """An editor in Orbit, what its talk had drawn last, and the lines told while nobody gave a command."""

    def __init__(self, source: str, client: LateClient, context: moderngl.Context | None, **view: object) -> None:
        self.client = client
        self.editor = Editor(client, source, resolution=RESOLUTION)
        self.feed = None if context is None else PictureFeed(context, self.editor.mode)
        self.editor.do(SetView.of(n_lights=40, n_bounces=1, **view))
        self.now, self.told = 0.0, set[str]()
        self.picture = np.zeros((1, 1, 3), np.float32)

    def frames(self, n: int = 1) -> None:
        for _ in range(n):
            self.now += FRAME_SECONDS
            before = self.editor.status.message_number
            if self.feed is not None:
                self.feed.take(self.editor, self.now)
                self.feed.draw(self.editor, 10.0)
            else:
                for event in self.editor.tick(self.now):
                    if isinstance(event, OrbitPicture):
                        self.picture = event.radiance
            status = self.editor.status
            if status.message_number != before and status.is_error:
                self.told.add(status.message)

    def until(self, done: Callable[[], bool]) -> None:
        for _ in range(MOST_FRAMES):
            if done():
                return
            self.frames()
        raise AssertionError(self.editor.status)

    def open(self) -> None:
        self.client.hurries = True
        self.until(lambda: self.editor.scene_is_open)
        self.editor.do(SetView.of(n_bounces=1))
        self.client.hurries = False

    def begin_again(self) -> None:
        """In Orbit, with nothing in hand, and a worker that takes many steps a frame."""
        self.editor.cancel_drag()
        self.editor.camera_history.end_drag()
        self.editor.resume_work()
        self.editor.do(SetView.of(mode="orbit", compare=None, solo=None))
        self.client.hurries = True

    def close(self) -> None:
        if self.feed is not None:
            self.feed.close()
        self.editor.close()


def plan_lines(**values: tuple[int, ...]) -> dict[str, Callable[[OrbitWalk], object]]:
    """Commands that set lines of the plan to one of these values, or leave them as planned."""
    return {
        f"{line} {value}": lambda w, line=line, value=value: w.editor.do(override_from_value(line, value))
        for line, own in values.items()
        for value in (*own, "auto")
    }


COMMANDS: dict[str, Callable[[OrbitWalk], object]] = {
    **{name: command for name, command in OTHERS.items() if name not in ("half", "float")},
    **{f"camera {i}": lambda w, c=c: w.editor.do(SetView.of(camera=c)) for i, c in enumerate(CAMERAS)},
    "the scene's camera": lambda w: w.editor.do(SetView.of(camera=None)),
    "a look undone": lambda w: w.editor.camera_history.undo(),
    "take hold of the camera": lambda w: w.editor.camera_history.begin_drag("orbit"),
    "let the camera go": lambda w: w.editor.camera_history.end_drag(),
    "turn a little": lambda w: w.editor.camera_history.set_viewpoint(replace_camera(w), "orbit"),
    "Placement": lambda w: w.editor.do(SetView.of(mode="placement")),
    "Orbit": lambda w: w.editor.do(SetView.of(mode="orbit")),
    "back to Orbit": lambda w: w.editor.do(SetView.of(mode="orbit")),
    "catch": lambda w: w.editor.do(SetShadowCatcher("ground", True)),
    "catch no more": lambda w: w.editor.do(SetShadowCatcher("ground", False)),
    "solo": lambda w: w.editor.do(SetView.of(solo="ball.0")),
    "all": lambda w: w.editor.do(SetView.of(solo=None)),
    "stop": lambda w: w.editor.cancel_work(),
    "bounces as planned": lambda w: w.editor.do(SetView.of(n_bounces=0)),
    "light once": lambda w: w.editor.do(SetView.of(n_bounces=1)),
    **{f"move {i}": lambda w, x=x: w.editor.do(SetTransform("ball", (x, 0.1, 0.0))) for i, x in enumerate((-0.1, 0.2))},
    "scale": lambda w: w.editor.do(SetTransform("ball", scale=(1.2, 0.9, 1.0))),
    "put back": lambda w: w.editor.do(SetTransform("ball")),
    **plan_lines(points=(1000, 5000), coefficients=(80, 640)),
}


def replace_camera(walk: OrbitWalk):  # type: ignore[no-untyped-def]
    """The look from a little farther right."""
    camera = walk.editor.camera_history.camera
    x, y, z = camera.position
    return walk.editor.view.viewpoint._replace(camera=camera.model_copy(update={"position": (x + 0.05, y, z)}))


@pytest.fixture
def source(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> str:
    monkeypatch.setattr("engine.realtime.triple_product.orbit_engine.Orbit", NamedOrbit)
    monkeypatch.setattr("engine.realtime.triple_product.moved_orbit.MovedOrbit", NamedMovedOrbit)
    return str(write_small_scene(tmp_path))


def stroll(walk: OrbitWalk, random: np.random.Generator, n_commands: int) -> list[str]:
    """Commands after any step of the worker; in the end nothing is in hand."""
    done = []
    for name in map(str, random.choice(sorted(COMMANDS), n_commands)):
        done.append(name)
        COMMANDS[name](walk)
        walk.frames(int(random.choice([0, 1, 3, 10, 30])))
    walk.begin_again()
    assert all(any(known in line for known in MAY_BE_TOLD) for line in walk.told), (done, walk.told)
    return done


def is_whole(editor: Editor) -> bool:
    """Whether the editor says that Orbit shows all it can of this document and view."""
    return isinstance(editor.controller, OrbitController) and editor.status.picture == "refining"


@pytest.mark.parametrize("seed", [0, 1, *(pytest.param(s, marks=pytest.mark.sweep) for s in range(2, 100))])
def test_the_last_picture_is_of_the_last_document_and_camera(source: str, tmp_path: Path, seed: int) -> None:
    random = np.random.default_rng(seed)
    walk = OrbitWalk(source, LateClient(random, ArrayCache(tmp_path / "cache")), None, mode="orbit")
    try:
        walk.open()
        done = stroll(walk, random, 25)
        walk.until(lambda: is_whole(walk.editor))
        n_channels = 4 if walk.editor.document.background.hides_environment else 3
        assert walk.picture.shape == (*RESOLUTION[::-1], n_channels)
        np.testing.assert_array_equal(walk.picture[0, 0, :3], expected_colour(walk.editor, source), err_msg=str(done))
        assert [mode.name for mode in MODES] == ["placement", "orbit", "deform"]
    finally:
        walk.close()


@pytest.mark.gl
@pytest.mark.parametrize("seed", [0, *(pytest.param(s, marks=pytest.mark.sweep) for s in range(1, 20))])
def test_what_is_seen_at_rest_is_placement_s_picture_of_a_fresh_start(
    context: moderngl.Context, source: str, tmp_path: Path, seed: int
) -> None:
    random = np.random.default_rng(seed)
    walk = OrbitWalk(source, LateClient(random, ArrayCache(tmp_path / "cache")), context, mode="orbit")
    try:
        walk.open()
        done = stroll(walk, random, 12)
        settled(walk)
        n_bounces = walk.editor.view.settings.n_bounces
        walk.editor.do(SetView.of(precision="float"))
        if n_bounces != 1:
            find_anew(walk, tmp_path)
        walk.frames()
        seen = settled(walk)
        session = tmp_path / "walk.insitu"
        assert walk.editor.save(session) is None
    finally:
        walk.close()
    fresh = OrbitWalk(str(session), LateClient(random, ArrayCache(tmp_path / "empty")), context)
    try:
        fresh.open()
        fresh.editor.do(SetView.of(mode="placement", n_lights=40, n_bounces=n_bounces))
        expected = settled(fresh)
    finally:
        fresh.close()
    assert relative_error(seen, expected) < TOLERANCE, done
    assert context.error == "GL_NO_ERROR"


def settled(walk: OrbitWalk) -> np.ndarray:
    """The linear picture of Placement, once nothing more comes."""
    walk.client.hurries = True
    feed = walk.feed
    assert feed is not None
    walk.until(lambda: walk.editor.status.is_finished and not feed.is_behind)
    walk.frames(3)
    source = feed.source.placement if isinstance(feed.source, OrbitFeed) else feed.source
    assert isinstance(source, PlacementFeed)
    return source.renderer.linear_image()
