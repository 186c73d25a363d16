"""A controller of indirect light at work, with answers put in the worker's mouth."""

from dataclasses import replace

import numpy as np

from app.document.described import document_from_description
from app.document.document import Selection
from app.modes.placement.curves import Curves
from app.modes.placement.indirect_controller import IndirectController
from app.modes.placement.placement_messages import (
    FreezeIndirect,
    IndirectFound,
    IndirectFrozen,
    IndirectNoise,
)
from engine.curve.operators import Operator
from engine.precompute.indirect.frozen_light import FrozenLight
from engine.scene.description import parse_description
from tests.app.fake_worker import SCENE, FakeClient

SELECTED = Selection("pot", 1, "theta_h")
LIFT = Operator("amplify", "y", 0.0, 0.0, 1.0, 1.2, magnitude=2.0)
ROWS, WEIGHTS = np.zeros((4, 4), np.int32), np.full((4, 4), 0.25, np.float32)


class StartedController:
    """A controller at work on the scene of the fake worker."""

    def __init__(self) -> None:
        self.client, self.curves, self.now = FakeClient(), Curves(), 0.0
        self.document = document_from_description("shelf", parse_description(SCENE, "shelf"))
        self.controller = IndirectController(self.client.send, self.curves)

    def update(
        self, selected: Selection | None = SELECTED, n_bounces: int = 3, revision: int = 1, second: int | None = None
    ):
        self.now += 0.1
        return self.controller.update(self.now, self.document, selected, n_bounces, second, revision)

    @property
    def asked(self) -> list[FreezeIndirect]:
        return [request for request in self.client.requests if isinstance(request, FreezeIndirect)]

    def found(self, number: int = 1, stage: str = "fine", revision: int = 1) -> None:
        self.controller.receive_samples(IndirectFound(number, stage, ROWS + number, WEIGHTS, revision=revision))

    def frozen(self, number: int = 1, noise: float | None = 0.02, is_last: bool = True) -> None:
        """The answer to the newest request: two samples a layer, powers 1, d and d²."""
        wish = self.asked[-1]
        reflected, bands = {}, {}
        for look in wish.scene.visible:
            if look.key in wish.curves:
                bands[look.key] = np.ones((3, len(look.coefficients[wish.curves[look.key]]), 3, 2), np.float32)
            else:
                reflected[look.key] = np.stack([np.full((2, 3), 10.0**n, np.float32) for n in range(3)])
        mine = [
            look for look in wish.scene.visible if look.key.rpartition(".")[0] == (wish.key or "").rpartition(".")[0]
        ]
        albedos = {look.key: np.ones((32, *(*map(len, look.coefficients), 1)[:2])) / 1e4 for look in mine}
        self.answer = replace(frozen_for(wish, reflected, bands, albedos, number), is_last=is_last)
        self.controller.receive_frozen(self.answer)
        if noise is not None:
            self.controller.receive_noise(IndirectNoise(number, wish.serial, noise, mean=0.5))

    def edit(self, key: str, factor: str, *operators: Operator) -> None:
        layer = self.document.layer(key)
        self.document = self.document.with_layer(key, layer.with_operators(factor, operators))
        self.controller.edited()


def frozen_for(
    wish: FreezeIndirect, reflected: dict[str, np.ndarray], bands: dict[str, np.ndarray],
    albedos: dict[str, np.ndarray], number: int = 1, unit: float = 1.0,
) -> IndirectFrozen:  # fmt: skip
    """The answer to a request: reflected (D, p, 3) and bands (3, J, D, p) by key."""
    keys = tuple(look.key for look in wish.scene.visible)
    by_number = {keys.index(key): np.ascontiguousarray(part.transpose(2, 0, 1)) for key, part in reflected.items()}
    light = FrozenLight(by_number, {keys.index(key): part for key, part in bands.items()})
    return IndirectFrozen(number, wish.serial, keys, wish.curves, light, albedos, unit)
