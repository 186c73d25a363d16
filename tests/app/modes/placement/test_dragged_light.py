"""Direct and indirect light while lights are dragged: any order of hands and answers, with a worker whose pictures hold
the number of the light that they were made for."""

from __future__ import annotations

import random
from collections.abc import Iterator

import numpy as np
import pytest

from app.document.commands.curves import SetOperators
from app.document.commands.light import SetEmission, SetEnvironment, SetRotation
from app.document.document import Document
from app.document.light_mix import emission_of
from app.document.scene_state import SceneState
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import Request, Response, SetCamera
from app.modes.placement.placement_events import IndirectRadiance, LayerRadiance
from app.modes.placement.placement_messages import (
    ComputeTransport,
    ContractTransport,
    FreezeIndirect,
    IndirectFound,
    IndirectFrozen,
    IndirectNoise,
    IndirectRelit,
    LayerPicture,
    StageDone,
)
from app.modes.placement.placement_status import RenderReport
from engine.curve.operators import Operator
from engine.precompute.indirect.frozen_light import FrozenLight
from tests.app.fake_worker import FakeClient, transport

ROWS, WEIGHTS = np.zeros((1, 4), np.int32), np.full((1, 4), 0.25, np.float32)
# What indirect light is brighter than its light's number, by albedo and with what glossy surfaces add.
BY_ALBEDO, WHOLE = 80_000.0, 100_000.0
LIFT = Operator("amplify", "y", 0.0, 0.0, 1.0, 1.2, magnitude=2.0)


def number_of(lit: SceneState | Document) -> float:
    """A number for all of the light: the rotation below 100, then the lamp, then the sky's radiance."""
    emission = emission_of(lit) if isinstance(lit, Document) else lit.emission
    sky, lamp = lit.light, dict(emission)["lamp"][0]
    return sky.rotation + 100.0 * lamp + 2000.0 * (0.0 if sky.radiance is None else sky.radiance[0])


class LitWorker:
    """Answers requests for transport and indirect light, one step at a time, as the worker does."""

    def __init__(self, client: FakeClient) -> None:
        self._client = client
        self._request: ComputeTransport | None = None
        self._steps: Iterator[list[Response]] = iter(())
        self._found: tuple[int, float, bool] | None = None  # number, light, whether glossy surfaces are known
        self._frozen: tuple[int, float, bool] | None = None
        self._answered: Request | None = None
        self._number, self._stage = 0, ""
        self._contracted: set[int] = set()

    def forget(self) -> None:
        """Another scene is open: nothing of the one before is known."""
        self._found = self._frozen = None

    @property
    def _view(self) -> int:
        """The number of the request by which the scene is seen."""
        return int(self._client.sent(SetCamera)[-1].id)

    @property
    def newest(self) -> ComputeTransport:
        """The transport requested last."""
        request: ComputeTransport = self._client.sent(ComputeTransport)[-1]
        return request

    def step(self) -> None:
        """Answer a little more of the newest request."""
        newest = self.newest
        if newest is not self._request:
            self._request, self._steps, self._stage = newest, self._stages(newest), ""
        freezing = self._freezing()
        self._contract()
        if freezing is not None and self._found is not None and self._found[1] == number_of(newest.scene):
            self._client.answer(freezing, *self._freeze(freezing))
        else:
            self._client.answer(newest, *next(self._steps, ()))

    def _contract(self) -> None:
        """Answer the requests for layers with other curves, once there are pictures."""
        assert self._request is not None
        for each in self._client.sent(ContractTransport):
            if each.revision == self._request.revision and each.id not in self._contracted and self._stage:
                self._contracted.add(each.id)
                light = np.full((1, 3), number_of(self._request.scene))
                picture = LayerPicture(each.layer.key, self._stage, light, each.layer.coefficients)
                self._client.answer(each, *([picture] if each.picture else []))
                if each.factor is not None and self._stage != "relit":
                    self._client.answer(each, transport(each.layer.key, each.factor, self._stage, each.precision))

    def _freezing(self) -> FreezeIndirect | None:
        """The newest request for a freezing under this transport that was not answered yet."""
        assert self._request is not None
        asked = self._client.sent(FreezeIndirect)
        if not asked or asked[-1].revision != self._request.revision or asked[-1] is self._answered:
            return None
        return asked[-1]

    def _stages(self, request: ComputeTransport) -> Iterator[list[Response]]:
        light = number_of(request.scene)
        if request.is_drag:
            yield self._pictures(request, "relit")
            if self._frozen is not None:
                yield [self._relit(request)]
            yield [StageDone("drag", True, 0.1)]
            return
        if self._found is not None and self._found[1] != light:
            yield self._find(request, False)
            yield self._refrozen(request)
        yield self._pictures(request, "preview")
        yield [StageDone("preview", False, 0.1)]
        yield self._pictures(request, "final")
        yield self._find(request, True)
        yield self._refrozen(request)
        yield [StageDone("final", True, 0.1)]

    def _pictures(self, request: ComputeTransport, stage: str) -> list[Response]:
        light, self._stage = np.full((1, 3), number_of(request.scene)), stage
        found: list[Response] = [
            LayerPicture(each.key, stage, light, each.coefficients) for each in request.scene.layers
        ]
        if request.factor is not None and request.selected is not None and stage != "relit":
            found += [
                transport(key, request.factor, stage, request.precision)
                for key in (request.selected, *request.followers)
            ]
        return found

    def _find(self, request: ComputeTransport, has_gloss: bool) -> list[Response]:
        if self._found is None or self._found[1:] != (number_of(request.scene), True):
            self._number += 1
            self._found = self._number, number_of(request.scene), has_gloss
        return [IndirectFound(self._found[0], "fine", ROWS, WEIGHTS, id=self._view)]

    def _refrozen(self, request: ComputeTransport) -> list[Response]:
        asked = self._client.sent(FreezeIndirect)
        return self._freeze(asked[-1]) if asked and asked[-1].revision == request.revision else []

    def _freeze(self, request: FreezeIndirect) -> list[Response]:
        assert self._found is not None
        number, of_light, has_gloss = self._found
        self._answered, self._frozen = request, self._found
        light = np.full((3, 1, 1), of_light + (WHOLE if has_gloss else BY_ALBEDO), np.float32)
        keys = tuple(look.key for look in request.scene.visible)
        reflected = FrozenLight(dict.fromkeys(range(len(keys)), light), {})
        return [
            IndirectFrozen(number, request.serial, keys, {}, reflected, {}, by_albedo=not has_gloss),
            IndirectNoise(number, request.serial, 0.01, 1.0, id=self._view),
        ]

    def _relit(self, request: ComputeTransport) -> IndirectRelit:
        """Of what glossy surfaces add, where that is known, half stays as it was and half is mirrored of the light as
        it is."""
        assert self._frozen is not None
        share = 0.5 if self._frozen[2] else 0.0
        keys = [look.key for look in request.scene.visible]
        now, resting, gloss, mirrored = (
            dict.fromkeys(keys, np.full((1, 3), value, np.float32))
            for value in (
                number_of(request.scene) + BY_ALBEDO, self._frozen[1] + BY_ALBEDO, 1.0 - share,
                share * (WHOLE - BY_ALBEDO),
            )
        )  # fmt: skip
        return IndirectRelit(self._frozen[0], now, resting, gloss, mirrored)


class Screen:
    """The editor with that worker, and the lights that its picture holds."""

    def __init__(self, editor: Editor, client: FakeClient) -> None:
        self.editor, self.client, self.worker, self.now = editor, client, LitWorker(client), 0.0
        self.direct, self.indirect = dict[str, float](), dict[str, float]()
        self.lights: list[float] = []  # direct light that was shown
        self.most_behind = 3  # lights; more where they change without a drag
        editor.do(SetView.of(n_bounces=3, selected=None))
        self.rest()

    def frame(self, n_steps: int = 1) -> None:
        for _ in range(n_steps):
            self.worker.step()
        self.now += 0.05
        for event in self.editor.tick(self.now):
            if isinstance(event, LayerRadiance):
                self.direct[event.key] = float(event.radiance[0, 0])
            elif isinstance(event, IndirectRadiance):
                self.indirect[event.key] = 0.0 if event.radiance is None else float(event.radiance[0, 0])
        self.editor.controller.rendered(RenderReport(128, 128, 0.0, True))
        self._check()

    def _check(self) -> None:
        shown = set(self.direct.values())
        if not shown:
            return
        assert len(shown) == 1
        if shown != set(self.lights[-1:]):
            self.lights += shown
        if any(self.indirect.values()):
            (light,) = set(self.indirect.values())
            # One behind while light is frozen, and one more in the first step of a drag.
            assert {light - WHOLE, light - BY_ALBEDO} & set(self.lights[-self.most_behind :])

    def rest(self) -> None:
        """Frames until nothing is left to come; the picture is then the document's."""
        for _ in range(60):
            self.frame(3)
        assert self.editor.status.is_finished
        light = number_of(self.editor.document)
        indirect = {light + WHOLE} if self.editor.view.settings.n_bounces > 1 else set()
        assert set(self.direct.values()) == {light} and set(self.indirect.values()) - {0.0} == indirect

    def turn(self, rotation: float) -> None:
        self.editor.do(SetRotation(rotation))

    def dim(self, radiance: float) -> None:
        self.editor.do(SetEmission("lamp", radiance))

    def open(self) -> None:
        """Open the scene again, as if it were another one."""
        self.editor.open("shelf")
        self.client.open_scene()
        self.worker.forget()
        self.now += 0.05
        self.editor.tick(self.now)
        self.direct, self.indirect, self.lights = {}, {}, []


@pytest.fixture
def screen(editor: Editor, client: FakeClient) -> Screen:
    return Screen(editor, client)


def test_indirect_light_turns_with_the_direct_light(screen: Screen) -> None:
    screen.editor.begin_drag()
    shown = []
    for rotation in range(31, 60):
        screen.turn(float(rotation))
        screen.frame()
        (direct,), (indirect,) = set(screen.direct.values()), set(screen.indirect.values())
        shown.append((direct, indirect - WHOLE))
    # All but the first step's appear together, and with what glossy surfaces added at rest.
    assert sum(direct != indirect for direct, indirect in shown) <= 1
    assert len(set(shown)) > 8
    screen.editor.end_drag()
    for _ in range(60):  # and stay together until the exact picture comes
        screen.frame()
        (direct,), (indirect,) = set(screen.direct.values()), set(screen.indirect.values())
        assert direct == indirect - WHOLE
    screen.rest()


def test_pictures_that_come_with_their_end_are_shown(screen: Screen) -> None:
    screen.editor.begin_drag()
    screen.turn(40.0)
    screen.frame()
    for rotation in (50.0, 60.0, 70.0):
        screen.turn(rotation)  # the next request is due when the answers to the one before are there
        requested = number_of(screen.worker.newest.scene)
        screen.frame(3)
        assert set(screen.direct.values()) == {requested}
        assert set(screen.indirect.values()) == {requested + WHOLE}


def test_a_light_that_is_dragged_back_has_its_exact_picture(screen: Screen) -> None:
    before = dict(screen.indirect)
    screen.editor.begin_drag()
    for rotation in (40.0, 50.0, 30.0):
        screen.turn(rotation)
        screen.frame(3)
    screen.editor.end_drag()
    screen.rest()
    assert screen.indirect == before


# What a user may do to the light, or meanwhile.
DEEDS = (
    "turn drag", "turn drag", "dim drag", "turn", "dim", "environment", "undo", "redo", "curve", "select", "bounces",
    "scene", "wait", "rest", "restart",
)  # fmt: skip


@pytest.mark.parametrize("seed", range(16))
def test_any_sequence_ends_with_the_light_of_the_document(screen: Screen, seed: int) -> None:
    chance, editor = random.Random(seed), screen.editor
    screen.most_behind = 12
    for _ in range(60):
        match chance.choice(DEEDS):
            case "turn drag" | "dim drag" as drag:
                editor.begin_drag()
                for _ in range(chance.randrange(1, 6)):
                    if drag == "dim drag":
                        screen.dim(float(chance.randrange(9)))
                    else:
                        screen.turn(float(chance.randrange(90)))
                    screen.frame(chance.randrange(4))
                editor.end_drag()
            case "turn":
                screen.turn(float(chance.randrange(90)))
            case "dim":
                screen.dim(float(chance.randrange(9)))
            case "environment":
                radiance = float(chance.randrange(4))
                editor.do(SetEnvironment("constant", radiance=(radiance, radiance, radiance)))
            case "undo":
                editor.undo()
            case "redo":
                editor.redo()
            case "curve":
                editor.do(SetOperators("floor.0", "theta_i", (LIFT,) if chance.random() < 0.5 else ()))
            case "select":
                editor.select(chance.choice((None, "floor.0.theta_i", "pot.1.theta_h")))
            case "bounces":
                editor.do(SetView.of(n_bounces=chance.choice((1, 3, 3))))
            case "scene" if chance.random() < 0.3:
                screen.open()
            case "wait":
                screen.frame(chance.randrange(3))
            case "rest" if chance.random() < 0.3:
                screen.rest()
            case "restart":
                editor.resume_work()
        screen.frame(chance.randrange(3))
    screen.rest()
