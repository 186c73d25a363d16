"""The first picture after objects were moved, and pictures of lamps that are dragged, as the worker answers them."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.light_state import LightState
from app.document.scene_state import SceneState
from app.messages.worker_messages import OpenScene, Request, RequestFailed, Response, SetCamera
from app.modes.placement.placement_messages import (
    ComputeTransport,
    FreezeIndirect,
    IndirectFound,
    IndirectFrozen,
    IndirectNoise,
    IndirectRelit,
    LayerPicture,
    StageDone,
)
from app.worker.cache import ArrayCache
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.light.suns import Sun
from engine.realtime.zonal_harmonics.pose import Poses
from engine.render.picture_difference import errors
from engine.scene.transform import Transform
from engine.settings import RenderSettings
from tests.app.worker.ball_and_lamp import pictures, work
from tests.quick_indirect import light_quickly
from tests.scene_text import LAMBERT, camera, environment, facing_down, facing_up, material, placed, scaled

SIZE, HEIGHT, SIDE, RADIANCE, ALBEDO = (40, 30), 1.5, 0.05, 400.0, 0.5
COATED = material('model = "lambert"', 'model = "rough_conductor", alpha = 0.3')
LAYERS = (work("floor.0", "lambert"), work("ball.0", "lambert"), work("ball.1", "rough_conductor", alpha=0.3))
NOON = Sun((0.3, 0.9, 0.3), (1.5, 1.2, 0.9), 4.0, "Noon")
OBJECT: Poses = (("ball", (Transform((0.4, 0.0, 0.2)),)),)
LAMP: Poses = (("lamp", (Transform((0.5, 0.0, -0.2)),)),)


class Worker:
    """A worker in this process with the scene open: a ball on a floor under a small lamp, and a sky."""

    def __init__(self, folder: Path, sky: float = 0.0, poses: Poses = ()) -> None:
        folder.mkdir(exist_ok=True)
        file = folder / "scene.toml"
        lamp = placed("lamp", "quad", facing_down(SIDE, (0, HEIGHT, 0)), f"emission = {[RADIANCE] * 3}\n")
        floor = placed("floor", "quad", facing_up(3), LAMBERT)
        ball = placed("ball", "sphere", scaled(0.4, (0.3, 0.3, 0.3)), COATED)
        file.write_text(camera((0, 2.2, 2.2), 45, SIZE) + environment([sky] * 3) + floor + ball + lamp)
        self._tasks = RequestDispatcher(ArrayCache(folder / "cache"))
        self.ask(OpenScene(str(file), id=1), SetCamera(1, None, SIZE, poses))

    def ask(self, *requests: Request) -> list[Response]:
        client = InProcessClient(self._tasks)
        for request in requests:
            client.send(request)
        answers = client.poll(budget_s=float("inf"))
        assert not any(isinstance(answer, RequestFailed) for answer in answers), answers
        return answers

    def look(self, poses: Poses, **changes: object) -> None:
        """Look at the scene with objects elsewhere."""
        self.ask(replace(SetCamera(1, None, SIZE, poses), **changes))  # type: ignore[arg-type]

    @property
    def hits(self):
        return self._tasks.context.open_placement.hits

    @property
    def scene(self):
        return self._tasks.context.open_placement.scene


def transport(light: LightState | None = None, n_bounces: int = 1, lamps: Poses = ()) -> ComputeTransport:
    emission = (("lamp", (RADIANCE, RADIANCE, RADIANCE)),)
    scene = SceneState(light or LightState(), LAYERS, emission, lamps)
    settings = RenderSettings(120, n_bounces=n_bounces)
    return ComputeTransport(scene, "ball.1", "theta_h", 40, settings, is_drag=bool(lamps))


def freezing(request: ComputeTransport) -> FreezeIndirect:
    return FreezeIndirect(request.scene, "ball.1", 0)


def irradiance(points: np.ndarray, lamp: tuple[float, float, float]) -> np.ndarray:
    """The irradiance (P,) of a horizontal floor by a small lamp that looks down: I cosθ / d², I = L A cosθ."""
    towards = np.array(lamp) - points
    square = np.einsum("pi,pi->p", towards, towards)
    cosine = towards[:, 1] / np.sqrt(square)
    return np.asarray(RADIANCE * SIDE**2 * cosine**2 / square)


def shadowed(points: np.ndarray, lamp: tuple[float, float, float], ball: tuple[float, float, float]) -> np.ndarray:
    """How far segments from the points (P, 3) to the lamp pass from the ball's surface; negative through it."""
    along = np.array(lamp) - points
    at = np.clip(np.einsum("pi,pi->p", np.array(ball) - points, along) / np.einsum("pi,pi->p", along, along), 0, 1)
    return np.asarray(np.linalg.norm(points + at[:, None] * along - np.array(ball), axis=1)) - 0.2


def assert_lit(
    worker: Worker, radiance: np.ndarray, lamp: tuple[float, float, float], ball: tuple[float, float, float]
):
    """The floor has the radiance ρ E / π where the lamp shines, and none in the ball's shadow."""
    begin, end = worker.hits.object_ranges[worker.scene.object_index("floor")]
    points = worker.hits.position[begin:end].astype(np.float64) + worker.scene.origin
    scale = LAYERS[0].layer.scale()
    passes = shadowed(points, lamp, ball)
    expected = ALBEDO / np.pi * irradiance(points, lamp)
    found = (radiance * scale)[:, 1]
    clear = passes > 0.06
    assert found[clear] == pytest.approx(expected[clear], rel=0.06)
    dark = passes < -0.06
    assert dark.sum() > 3 and (found[dark] < 0.01 * expected[dark]).all()


def test_a_dragged_lamp_lights_the_floor_from_where_it_is(tmp_path: Path) -> None:
    worker = Worker(tmp_path / "a")
    before = pictures(worker.ask(transport()))
    assert_lit(worker, before["floor.0"], (0, HEIGHT, 0), (0.3, 0.3, 0.3))
    answers = worker.ask(transport(lamps=LAMP))
    assert_lit(worker, pictures(answers, "relit")["floor.0"], (0.5, HEIGHT, -0.2), (0.3, 0.3, 0.3))
    assert isinstance(answers[-1], StageDone) and answers[-1].exact
    there = pictures(worker.ask(transport(lamps=(("lamp", (Transform((1e-9, 0.0, 0.0)),)),))), "relit")
    for key, picture in before.items():  # back where it was: the picture at rest is what all begin with
        assert errors(there[key], picture).rmse < 0.02
    assert pictures(worker.ask(transport()))["floor.0"] is not None


@pytest.mark.parametrize("poses", [OBJECT, LAMP, OBJECT + LAMP], ids=["ball", "lamp", "both"])
def test_the_first_picture_after_a_move_is_near_the_last_which_is_that_of_a_fresh_start(
    poses: Poses, tmp_path: Path
) -> None:
    light = LightState(own_suns=(NOON,), new_suns=(NOON,))
    fresh = pictures(Worker(tmp_path / "fresh", 0.2, poses).ask(transport(light)))
    worker = Worker(tmp_path / "moved", 0.2)
    worker.ask(transport(light))
    worker.look(poses)
    answers = worker.ask(transport(light))
    first, last = pictures(answers, "relit"), pictures(answers)
    order = [(each.stage, each.key) for each in answers if isinstance(each, LayerPicture)]
    assert [stage for stage, _ in order[:3]] == ["relit"] * 3 and "preview" not in [stage for stage, _ in order]
    for key, picture in fresh.items():
        assert np.array_equal(last[key], picture)
        assert errors(first[key], picture).rmse < 0.06, key


def test_what_no_moved_shadow_meets_stays_to_the_bit(tmp_path: Path) -> None:
    worker = Worker(tmp_path / "moved")
    before = floor_by_pixel(worker, pictures(worker.ask(transport())))
    worker.look(OBJECT)
    first = floor_by_pixel(worker, pictures(worker.ask(transport()), "relit"))
    both = before.keys() & first.keys()
    changed = {pixel for pixel in both if not np.array_equal(before[pixel], first[pixel])}
    assert 20 < len(changed) < 0.3 * len(both)


def floor_by_pixel(worker: Worker, found: dict[str, np.ndarray]) -> dict[int, np.ndarray]:
    """What the floor sends at pixels' centres."""
    begin, end = worker.hits.object_ranges[worker.scene.object_index("floor")]
    centred = worker.hits.is_centred[begin:end]
    return dict(zip(worker.hits.pixel[begin:end][centred].tolist(), found["floor.0"][centred], strict=True))


def test_a_ball_moved_twice_at_once_is_shown_from_the_picture_before_both(tmp_path: Path) -> None:
    worker = Worker(tmp_path / "moved")
    worker.ask(transport())
    worker.look(LAMP)
    worker.look(OBJECT)
    first = pictures(worker.ask(transport()), "relit")
    assert_lit(worker, first["floor.0"], (0, HEIGHT, 0), (0.7, 0.3, 0.5))


def test_another_camera_or_material_begins_anew(tmp_path: Path) -> None:
    worker = Worker(tmp_path / "moved")
    worker.ask(transport())
    worker.look(OBJECT, resolution=(20, 15))
    assert not pictures(worker.ask(transport()), "relit")
    worker.look(OBJECT[:0], resolution=(20, 15))
    matt = replace(LAYERS[2], layer=LAYERS[2].layer.with_parameter("alpha", 0.5))
    request = transport()
    changed = replace(request, scene=replace(request.scene, layers=(*LAYERS[:2], matt)))
    assert not pictures(worker.ask(changed), "relit")


def test_light_between_surfaces_is_carried_until_it_is_found_anew(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    light_quickly(monkeypatch)
    request = transport(n_bounces=3)
    fresh = Worker(tmp_path / "fresh", 0.2, OBJECT).ask(request, freezing(request))
    worker = Worker(tmp_path / "moved", 0.2)
    before = worker.ask(request, freezing(request))
    worker.look(OBJECT)
    answers = worker.ask(request, freezing(request))
    # What the gather points send moves with them: it is not reflected again, and its noise is that of another view.
    frozen = [[e for e in each if isinstance(e, IndirectFrozen)] for each in (before, answers)]
    assert frozen[1][0].light is frozen[0][-1].light and frozen[1][0].number != frozen[0][-1].number
    noises = [each.number for each in answers if isinstance(each, IndirectNoise)]
    assert frozen[1][0].number not in noises and frozen[1][-1].number in noises
    found = [each.stage for each in answers if isinstance(each, IndirectFound)]
    assert found[0] == "carried" and found[-1] == "fine" and "rough" not in found
    first_done = next(i for i, each in enumerate(answers) if isinstance(each, StageDone))
    assert any(isinstance(each, IndirectFrozen) for each in answers[:first_done])
    last, expected = ([e for e in each if isinstance(e, IndirectFrozen)][-1].light for each in (answers, fresh))
    for key, powers in expected.reflected.items():
        assert np.array_equal(last.reflected[key], powers)


def test_light_between_surfaces_is_carried_from_the_view_before_two_moves(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    light_quickly(monkeypatch)
    request = transport(n_bounces=3)
    away: Poses = (("ball", (Transform((-0.6, 0.1, 0.0)),)),)
    carried = []
    for name, views in (("at once", (away,)), ("twice", (OBJECT, away))):
        worker = Worker(tmp_path / name, 0.2)
        worker.ask(request, freezing(request))
        for poses in views:
            worker.look(poses)
        answers = worker.ask(request, freezing(request))
        carried.append(next(each for each in answers if isinstance(each, IndirectFound)))
        assert carried[-1].stage == "carried"
    # The same places of the same objects: what the view between them showed is nothing to these.
    assert np.array_equal(carried[0].rows, carried[1].rows)
    assert np.array_equal(carried[0].weights, carried[1].weights)


def test_light_between_surfaces_follows_a_dragged_lamp(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    """On the other side of the floor's middle the lamp gives the ball's lower half more light by the floor."""
    light_quickly(monkeypatch)
    worker, request = Worker(tmp_path / "dragged"), transport(n_bounces=3)
    worker.ask(request, freezing(request))
    still, *_ = relit(worker.ask(transport(n_bounces=3, lamps=(("lamp", (Transform((1e-9, 0, 0)),)),))))
    near, *_ = relit(worker.ask(transport(n_bounces=3, lamps=(("lamp", (Transform((0.3, 0, 0.3)),)),))))
    far, *_ = relit(worker.ask(transport(n_bounces=3, lamps=(("lamp", (Transform((-1.2, 0, -1.2)),)),))))
    light = [float(np.sum(each.now["ball.0"])) for each in (far, still, near)]
    assert light[0] < 0.5 * light[1] and light[1] < light[2]
    assert np.allclose(still.now["ball.0"], still.resting["ball.0"], rtol=0.02, atol=1e-4)


def relit(answers: list[Response]) -> list[IndirectRelit]:
    return [each for each in answers if isinstance(each, IndirectRelit)]
