"""Each mode at work on the tiny scene: what is asked of the worker, and the picture that it shows in the end."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import partial

import numpy as np

from app.document.described import document_from_description
from app.document.scene_state import scene_state
from app.messages.worker_messages import Request, Response
from app.modes.deform.deform_messages import DrawDeform, PrepareDeform
from app.modes.orbit.orbit_messages import DrawOrbit, OrbitPictureDrawn, OrbitProgress, PrepareOrbit
from app.modes.placement.placement_messages import LayerPicture, StageDone
from app.modes.registry import DEFORM, ORBIT, PLACEMENT
from app.worker.cache import ArrayCache
from app.worker.deform_worker import DeformWorker
from app.worker.orbit_worker import OrbitWorker
from app.worker.schedule import InProcessClient
from app.worker.tasks import RequestDispatcher
from engine.realtime.zonal_harmonics.pose import Deformation
from engine.scene.scene_loader import load_scene
from tests.app.worker.ball_and_lamp import SCENE as BALL
from tests.app.worker.ball_and_lamp import compute
from tests.opened import ask_for_scene

HANDLERS = "tests.app.worker.small_modes:small_tasks"
# A cube has a few vertices, and each of them has transfer of its own.
SCENE = BALL.replace('"sphere"', '"cube"')
SIZE = (24, 18)
POSES = (("ball", (Deformation("bend", 40.0),)),)


class SmallOrbitWork(OrbitWorker):
    """Orbit's, with few points."""

    n_points = 300


class SmallDeformWork(DeformWorker):
    """Deform's, with few points and rays."""

    n_points, n_rays = 60, 16


SMALL_MODES = (
    PLACEMENT,
    replace(ORBIT, worker=f"{__name__}:{SmallOrbitWork.__name__}"),
    replace(DEFORM, worker=f"{__name__}:{SmallDeformWork.__name__}"),
)


def small_tasks(store: ArrayCache | None = None) -> RequestDispatcher:
    """The worker's, with fewer points and rays than it takes for pictures that are looked at."""
    return RequestDispatcher(store, modes=SMALL_MODES)


@dataclass(frozen=True)
class Shown:
    """prepare: the request for all that the last picture is drawn of; is_ready: whether an answer says that it is;
    draw: the request for the picture, where it is not among the answers."""

    prepare: Request
    is_ready: Callable[[Response], bool]
    draw: Request | None = None


def shown_by(mode: str, source: str) -> Shown:
    """What a mode is asked for, as its talk does."""
    scene = load_scene(source, SIZE)
    state, eye = scene_state(document_from_description(source, scene.description)), scene.description.camera
    if mode == "placement":
        return Shown(compute(), lambda answer: isinstance(answer, StageDone) and answer.exact)
    prepare, draw = {
        "orbit": (PrepareOrbit(state, 1), DrawOrbit(eye, SIZE, "rest")),
        "deform": (PrepareDeform(state, 1, ("ball",)), DrawDeform(eye, SIZE, "rest", POSES)),
    }[mode]
    return Shown(prepare, lambda answer: isinstance(answer, OrbitProgress) and answer.is_done, draw)


def in_process(mode: str, source: str, store: ArrayCache) -> np.ndarray:
    """The picture, computed here."""
    client, shown = InProcessClient(small_tasks(store)), shown_by(mode, source)
    ask_for_scene(client, source, resolution=SIZE)
    poll = partial(client.poll, budget_s=float("inf"))
    poll()
    client.send(shown.prepare)
    answers = poll()
    if shown.draw is not None:
        client.send(shown.draw)
        answers += poll()
    return picture_in(answers)


def picture_in(answers: list[Response]) -> np.ndarray:
    """The last one: of Placement all its layers', one after another."""
    drawn = [answer.radiance for answer in answers if isinstance(answer, OrbitPictureDrawn)]
    return np.array(drawn[-1]) if drawn else np.concatenate(list(final_layers(answers)))


def final_layers(answers: list[Response]) -> Iterator[np.ndarray]:
    last = {answer.key: answer for answer in answers if isinstance(answer, LayerPicture) and answer.stage == "final"}
    yield from (np.asarray(last[key].radiance) for key in sorted(last))
