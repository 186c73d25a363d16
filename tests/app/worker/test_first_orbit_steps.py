"""Before Orbit has placed anything its work is in short steps, between which plain pictures are drawn."""

from pathlib import Path

from app.messages.worker_messages import Progress, Response
from app.modes.orbit.orbit_messages import DrawHeadlight, OrbitNotReady, OrbitPictureDrawn, PrepareOrbit
from app.worker.cache import ArrayCache
from app.worker.tasks import RequestDispatcher
from engine.light.environment import constant_environment
from engine.realtime.triple_product import incident
from engine.scene.description import Camera
from tests.app.worker.ball_and_lamp import SCENE, compute
from tests.opened import open_in_process

CAMERA = Camera(position=(0.4, 1.6, 2.6), target=(0.0, 0.3, 0.0))


def forget_skies() -> None:
    incident._averaging_matrix.cache_clear()
    incident._map_and_peaks.cache_clear()


def drawn(tasks: RequestDispatcher) -> Response:
    (answer,) = [each for each in tasks.handle(DrawHeadlight(CAMERA, (8, 6), compute().scene)) if each is not None]
    return answer


def test_the_sky_is_prepared_step_by_step_and_made_of_what_the_steps_remember() -> None:
    forget_skies()
    environment = constant_environment((2.0, 1.0, 0.5))
    steps = incident.preparing_sky(environment)
    most, before = 0, 0
    for _ in steps:
        now = incident._averaging_matrix.cache_info().misses
        most, before = max(most, now - before), now
    assert most == 1 and incident._averaging_matrix.cache_info().misses > 8  # no step does more than a part of it
    made = incident._map_and_peaks.cache_info().misses
    incident.make_sky(environment, 30.0)
    assert incident._map_and_peaks.cache_info().misses == made


def test_plain_pictures_are_drawn_before_orbit_has_made_its_sky(tmp_path: Path) -> None:
    forget_skies()
    (tmp_path / "scene.toml").write_text(SCENE)
    tasks = RequestDispatcher(ArrayCache(tmp_path / "cache"))
    open_in_process(tasks, str(tmp_path / "scene.toml"), resolution=(8, 6))
    steps = (each for each in tasks.handle(PrepareOrbit(compute().scene)) if isinstance(each, Progress))
    for n_steps in range(8):
        assert isinstance(next(steps), Progress) and incident._averaging_matrix.cache_info().misses <= n_steps
        assert isinstance(drawn(tasks), OrbitPictureDrawn)


def test_without_a_scene_it_is_said_that_there_is_nothing_to_draw() -> None:
    assert isinstance(drawn(RequestDispatcher()), OrbitNotReady)
