"""Mouse and keyboard events, in their order, on their way to imgui.

imgui has a state, no history: of the events between two of its frames it would see the end. It spreads presses of one
button or key over frames by itself, but not chords: of Z pressed and Ctrl released in one long frame it would see Z
alone, and of a drag that ends in one it would not see where. So each pass of the panels gets one act at most, a press,
a release or turns of the wheel, with the position and the modifiers at that time. Text is the exception: while a field
takes it, all characters that have come are passed together, with the keys that typed them. A press of the mouse, or a
turn of its wheel, also waits for a pass in which the mouse is in its place already: items that others may overlap
(rows, tabs) react only where the pass before found the mouse over them. The shell passes through its panels until all
events are processed (`ui.shell`).
"""

from __future__ import annotations

from collections import deque
from collections.abc import Callable
from enum import Enum
from functools import partial

from imgui_bundle import imgui

Key = imgui.Key
MODIFIERS = frozenset(
    {Key.left_ctrl, Key.right_ctrl, Key.mod_ctrl, Key.left_shift, Key.right_shift, Key.mod_shift, Key.left_alt,
     Key.right_alt, Key.mod_alt, Key.left_super, Key.right_super, Key.mod_super}
)  # fmt: skip
ALTS = frozenset({Key.left_alt, Key.right_alt})
CTRLS = frozenset({Key.left_ctrl, Key.right_ctrl, Key.mod_ctrl})


class _Kind(Enum):
    """Kinds of events: those that may come before an act (`STATE`, `MOVE`, `CTRL` goes down, `TEXT` is typed), and the
    acts: of keys `PRESS` and `TYPE`, which makes a character, of the mouse the others."""

    STATE, MOVE, CTRL, TEXT, PRESS, TYPE, CLICK, RELEASE, WHEEL = range(9)


_ACTS = frozenset({_Kind.PRESS, _Kind.TYPE, _Kind.CLICK, _Kind.RELEASE, _Kind.WHEEL})
_AFTER_A_MOVE = frozenset({_Kind.STATE, _Kind.MOVE, _Kind.CTRL, _Kind.TEXT, _Kind.PRESS, _Kind.TYPE})
_TYPING = frozenset({_Kind.TYPE, _Kind.TEXT})


def _can_share_pass(heard: set[_Kind], next_kind: _Kind) -> bool:
    """Whether a pass that has processed these kinds may process the next event as well."""
    if not heard:
        return True
    if heard & _ACTS:
        return heard == {_Kind.WHEEL} and next_kind is _Kind.WHEEL
    if _Kind.MOVE in heard:
        return next_kind in _AFTER_A_MOVE
    return next_kind is not _Kind.RELEASE


class EventQueue:
    """Events enter in order; `dispatch` gives imgui those of the coming pass.

    `alt_tapped` is whether, in this pass, Alt was released with nothing else done since it was pressed; `repeated` is
    the key that the system reports as still held, None where it reports none. imgui's own controls repeat by imgui's
    clock.
    """

    def __init__(self, context: imgui.internal.Context, io: imgui.IO) -> None:
        self._context = context
        self._io = io
        self._waiting = deque[tuple[_Kind, Callable[[], None]]]()
        self._alt_alone = False
        self.alt_tapped = False
        self.repeated: imgui.Key | None = None

    @property
    def is_empty(self) -> bool:
        """Whether imgui has got all events."""
        return not self._waiting and self._context.input_events_queue.size() == 0

    def move(self, x: float, y: float) -> None:
        """The mouse has moved, framebuffer pixels."""
        self._add(partial(self._io.add_mouse_pos_event, x, y), _Kind.MOVE)

    def button(self, button: int, pressed: bool) -> None:
        """A mouse button was pressed or released: 0 left, 1 right, 2 middle."""
        self._alt_alone = False
        kind = _Kind.CLICK if pressed else _Kind.RELEASE
        self._add(partial(self._io.add_mouse_button_event, button, pressed), kind)

    def wheel(self, x: float, y: float) -> None:
        """The wheel turned, notches; y positive forward, away from the user."""
        self._alt_alone = False
        self._add(partial(self._io.add_mouse_wheel_event, x, y), _Kind.WHEEL)

    def key(self, key: imgui.Key, pressed: bool) -> None:
        """A key, or the role of one (`mod_ctrl`)."""
        if key in ALTS and not pressed and self._alt_alone:
            self._add(self._tap)
        if key != Key.mod_alt:
            self._alt_alone = key in ALTS and pressed
        kind = _Kind.STATE if not pressed or key in MODIFIERS else _Kind.PRESS
        if pressed and key in CTRLS:
            kind = _Kind.CTRL
        self._add(partial(self._io.add_key_event, key, pressed), kind)

    def repeat(self, key: imgui.Key) -> None:
        """The system repeats a key that is held."""
        self._add(partial(self._repeat_key, key), _Kind.PRESS)

    def character(self, code: int) -> None:
        """A character was typed, by the key that was pressed, or repeated, just before."""
        if self._waiting and self._waiting[-1][0] is _Kind.PRESS:
            self._waiting[-1] = _Kind.TYPE, self._waiting[-1][1]
        self._add(partial(self._io.add_input_character, code), _Kind.TEXT)

    def focus(self, gained: bool) -> None:
        """The window has got the keyboard, or lost it."""
        self._alt_alone = False
        self._add(partial(self._io.add_focus_event, gained))

    def dispatch(self, is_typing: bool = False, waits: bool = False) -> None:
        """Give imgui the events of the coming pass: none while it still spreads those it was given before.

        is_typing: whether a field takes text. waits: whether this pass is to get no events.
        """
        self.alt_tapped, self.repeated = False, None
        self._io.config_input_trickle_event_queue = True
        if waits or self._context.input_events_queue.size() > 0:
            return
        if is_typing and next((kind for kind, _ in self._waiting if kind is not _Kind.STATE), None) in _TYPING:
            # imgui would spread them: of a letter typed twice it would take the second in its next pass. Ctrl would
            # make it drop them all, and so ends the run.
            self._io.config_input_trickle_event_queue = False
            while self._waiting and (self._waiting[0][0] in _TYPING or self._waiting[0][0] is _Kind.STATE):
                self._waiting.popleft()[1]()
            return
        heard = set[_Kind]()
        while self._waiting and _can_share_pass(heard, self._waiting[0][0]):
            kind, give = self._waiting.popleft()
            heard.add(kind)
            give()

    def _tap(self) -> None:
        self.alt_tapped = True

    def _repeat_key(self, key: imgui.Key) -> None:
        self.repeated = key

    def _add(self, give: Callable[[], None], kind: _Kind = _Kind.STATE) -> None:
        self._waiting.append((kind, give))
