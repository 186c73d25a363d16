"""The script of edits: slow drags, jumps and undo, the same for every program and every run.

A drag is steps of one parameter, a quarter of a second apart, the last of which is let go and rests. Jumps set a value
at once. Undo takes back a whole drag or a jump. The values are drawn with a fixed seed, few of them, since each state
of the scene needs a long path-traced picture.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np

Kind = Literal["drag", "release", "jump", "undo"]
Value = float | tuple[float, float, float]

STEP_SECONDS, REST_SECONDS = 0.25, 3.0
SEED = 9
N_STEPS = 5
# A step may go this far from its place among equal ones.
UNEVEN = 0.3


@dataclass(frozen=True)
class Parameter:
    """A parameter of a layer that the script edits: `back.1.alpha`, and the value that the scene has."""

    object: str
    layer: int
    name: str
    value: Value

    @property
    def path(self) -> str:
        return f"{self.object}.{self.layer}.{self.name}"


@dataclass(frozen=True)
class Edit:
    """One parameter becomes `value`; the picture is watched for `horizon_s` from then on. state: number among the
    states that the script visits, 0 the scene as it opens."""

    kind: Kind
    parameter: Parameter
    value: Value
    state: int

    @property
    def horizon_s(self) -> float:
        return STEP_SECONDS if self.kind == "drag" else REST_SECONDS


@dataclass(frozen=True)
class Script:
    """Edits in order; states: the value of each of the parameters, a row for each."""

    parameters: tuple[Parameter, ...]
    edits: tuple[Edit, ...]
    states: tuple[tuple[Value, ...], ...]


def script_of(dragged: Parameter, to: float, jumps: Sequence[tuple[Parameter, Value]], seed: int = SEED) -> Script:
    """25 edits: a drag, taken back, dragged there again and back by hand, and jumps in between.

    dragged: a number, to where it is dragged; jumps: three, made one at a time from the scene as it opens.
    """
    rng = np.random.default_rng(seed)
    assert isinstance(dragged.value, float)
    shares = np.arange(1, N_STEPS + 1) / N_STEPS
    shares[:-1] += rng.uniform(-UNEVEN, UNEVEN, N_STEPS - 1) / N_STEPS
    there = [round(dragged.value + float(share) * (to - dragged.value), 4) for share in shares]
    back = [*reversed(there[:-1]), dragged.value]
    first, second, third = (jumps[i] for i in rng.permutation(3))
    parameters = tuple({each.path: each for each in (dragged, *(each for each, _ in jumps))}.values())
    writer = _Writer(parameters)
    writer.drag(dragged, there)
    writer.undo()
    for jump in (first, second):
        writer.jump(*jump)
        writer.undo()
    writer.drag(dragged, there)
    writer.drag(dragged, back)
    for jump in (third, first):
        writer.jump(*jump)
        writer.undo()
    writer.jump(*second)
    return Script(parameters, tuple(writer.edits), tuple(writer.states))


class _Writer:
    """A script while it is written, with the states that undo returns to."""

    def __init__(self, parameters: tuple[Parameter, ...]) -> None:
        self.parameters = parameters
        self.state = tuple(each.value for each in parameters)
        self.states = [self.state]
        self.edits: list[Edit] = []
        self.history: list[tuple[Parameter, Value]] = []

    def drag(self, parameter: Parameter, values: Sequence[float]) -> None:
        self._remember(parameter)
        for value in values[:-1]:
            self._edit("drag", parameter, value)
        self._edit("release", parameter, values[-1])

    def jump(self, parameter: Parameter, value: Value) -> None:
        self._remember(parameter)
        self._edit("jump", parameter, value)

    def undo(self) -> None:
        self._edit("undo", *self.history.pop())

    def _remember(self, parameter: Parameter) -> None:
        self.history.append((parameter, self.state[self.parameters.index(parameter)]))

    def _edit(self, kind: Kind, parameter: Parameter, value: Value) -> None:
        place = self.parameters.index(parameter)
        self.state = (*self.state[:place], value, *self.state[place + 1 :])
        if self.state not in self.states:
            self.states.append(self.state)
        self.edits.append(Edit(kind, parameter, value, self.states.index(self.state)))
