"""Events on their way to imgui: any sequence, however it is bunched, is heard in its order."""

from __future__ import annotations

from collections.abc import Iterator
from random import Random

import pytest
from imgui_bundle import ImVec2, imgui

from ui.event_queue import EventQueue

Key = imgui.Key
LETTERS = (Key.z, Key.a, Key.x, Key.right_arrow)
ROLES = (Key.mod_ctrl, Key.mod_shift, Key.mod_alt)
SIDES = {Key.mod_ctrl: Key.left_ctrl, Key.mod_shift: Key.right_shift, Key.mod_alt: Key.left_alt}
WHEEL, TAP = "wheel", "tap"


@pytest.fixture
def queue() -> Iterator[EventQueue]:
    """A queue before an imgui of its own, that draws nothing."""
    context = imgui.create_context()
    imgui.set_current_context(context)
    io = imgui.get_io()
    io.set_ini_filename("")
    io.backend_flags |= imgui.BackendFlags_.renderer_has_textures
    io.display_size = ImVec2(200.0, 100.0)
    yield EventQueue(context, io)
    imgui.destroy_context(context)


def heard(queue: EventQueue, passes: int = 1000) -> list[object]:
    """What imgui makes of all that waits: chords pressed, buttons (with places), notches of the wheel, taps of Alt."""
    found: list[object] = []
    io = imgui.get_io()
    for _ in range(passes):
        if queue.is_empty:
            return found
        queue.dispatch()
        io.delta_time = 1e-3
        imgui.new_frame()
        at = (imgui.get_mouse_pos().x, imgui.get_mouse_pos().y)
        keys = [(key, io.key_mods) for key in LETTERS if imgui.is_key_pressed(key, False)]
        assert len(keys) <= 1
        found += keys
        found += [(button, "down", at) for button in range(3) if imgui.is_mouse_clicked(button)]
        found += [(button, "up", at) for button in range(3) if imgui.is_mouse_released(button)]
        if io.mouse_wheel:
            found += [WHEEL] * round(io.mouse_wheel)
        if queue.alt_tapped:
            found.append(TAP)
        imgui.end_frame()
    raise AssertionError("it never comes to an end")


def test_any_sequence_is_heard_in_its_order(queue: EventQueue) -> None:
    for seed in range(60):
        hand = Hand(Random(seed), queue)
        expected, got = list[object](), list[object]()
        for _ in range(40):
            expected += hand.does_something()
            if hand.random.random() < 0.15:
                got += heard(queue)
        expected += hand.lets_go()
        got += heard(queue)
        assert got == expected, seed


class Hand:
    """Does what hands do, at random, and says what should be heard of it."""

    def __init__(self, random: Random, queue: EventQueue) -> None:
        self.random, self._queue = random, queue
        self._held: set[imgui.Key] = set()
        self._down: set[int] = set()
        self._alone = False
        self._moves()

    def does_something(self) -> list[object]:
        return self.random.choice((self._types, self._types, self._shifts, self._moves, self._clicks, self._turns))()

    def lets_go(self) -> list[object]:
        found: list[object] = []
        for role in sorted(self._held, key=int):
            found += self._modifier(role, False)
        for button in sorted(self._down):
            self._queue.button(button, False)
            found.append((button, "up", self._at))
        return found

    def _types(self) -> list[object]:
        key = self.random.choice(LETTERS)
        self._queue.key(key, True)
        self._queue.key(key, False)
        self._alone = False
        return [(key, sum(int(role) for role in self._held))]

    def _shifts(self) -> list[object]:
        role = self.random.choice(ROLES)
        return self._modifier(role, role not in self._held)

    def _modifier(self, role: imgui.Key, down: bool) -> list[object]:
        tapped = role == Key.mod_alt and not down and self._alone
        self._alone = role == Key.mod_alt and down
        self._queue.key(SIDES[role], down)
        self._queue.key(role, down)
        self._held ^= {role}
        return [TAP] if tapped else []

    def _moves(self) -> list[object]:
        self._at = (float(self.random.randrange(200)), float(self.random.randrange(100)))
        self._queue.move(*self._at)
        return []

    def _clicks(self) -> list[object]:
        button = self.random.randrange(3)
        down = button not in self._down
        self._down ^= {button}
        self._alone = False
        self._queue.button(button, down)
        return [(button, "down" if down else "up", self._at)]

    def _turns(self) -> list[object]:
        self._alone = False
        self._queue.wheel(0.0, 1.0)
        return [WHEEL]
