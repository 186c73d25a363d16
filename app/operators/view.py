"""Operators on the view: the mode, the comparison, exposure, layout, and what scripts wait for."""

from __future__ import annotations

from typing import Annotated, Literal

from pydantic import Field

from app.document.selection import layer_shown, toggle_solo
from app.document.view_state import LIGHTING_WORDS, SetView, Viewpoint
from app.editor.editor import Editor
from app.files.bookmarks import add_bookmark, find_bookmark, rename_bookmark
from app.operators.edits import PictureIndex
from app.operators.operator import LAYER, SCENE, Gesture, Need, Operator, OperatorContext, ScriptKey
from engine.core.colour import find_view
from engine.core.errors import InsituError, LoadError
from engine.scene.description import Number, Text
from engine.settings import Lighting

AwaitedPicture = Literal["first", "orbit", "exact", "error"]
PLACEMENT = Need(
    "open a scene in Placement, which alone shows simple lighting",
    lambda context: bool(context.document.objects) and context.view.mode == "placement",
)
STOPS_A_PRESS = 1.0 / 3.0


def _choose_mode(editor: Editor, name: str) -> str | None:
    names = [mode.name for mode in editor.modes]
    if name not in names:
        raise InsituError(f"mode: there is no {name!r}; available: {', '.join(names)}")
    return editor.do(SetView.of(mode=name))


def _toggle_mode(editor: Editor, name: str) -> str | None:
    """Switch to the mode of this name where there is one, or to the first where it is the present mode already."""
    names = [mode.name for mode in editor.modes]
    return editor.do(SetView.of(mode=name if name in names and editor.mode.name != name else names[0]))


def _toggle_comparison(editor: Editor, value: None) -> str | None:
    if editor.view.compare is not None:
        return editor.do(SetView.of(compare=None))
    return editor.do(SetView.of(compare=editor.document, stored=""))


def _choose_lighting(editor: Editor, lighting: Lighting | None) -> str | None:
    """Show this light, or the next one: in place, without shadows, of one light, and in place again."""
    names = list(LIGHTING_WORDS)
    after = names[(names.index(editor.view.lighting) + 1) % len(names)]
    return editor.do(SetView.of(lighting=lighting or after))


def _expose(editor: Editor, stops: float) -> str | None:
    return editor.do(SetView.of(exposure=editor.view.exposure + stops))


def _solo(editor: Editor, value: None) -> str | None:
    selected = layer_shown(editor.document, editor.view.selected)
    return None if selected is None else editor.do(toggle_solo(editor.view, selected.key))


def is_pixel_for_pixel(context: OperatorContext) -> bool:
    """Whether a pixel of the picture is one of the screen."""
    return not context.view.fit and context.view.zoom == 1.0


def _choose_view(editor: Editor, name: str) -> str | None:
    """Show light through one of the views of `engine.core.colour`; any other name is that of a bookmarked view."""
    try:
        tone_mapping = find_view(name)
    except LoadError:
        return editor.camera_history.set_viewpoint(find_bookmark(editor.view.bookmarks, name).viewpoint, name)
    return editor.do(SetView.of(tone_mapping=tone_mapping))


def _save_view(editor: Editor, name: str | None) -> str | None:
    look = Viewpoint(editor.camera_history.camera, editor.view.resolution)
    return editor.do(SetView.of(bookmarks=add_bookmark(editor.view.bookmarks, look, name)))


def _rename_view(editor: Editor, names: tuple[str, str]) -> str | None:
    return editor.do(SetView.of(bookmarks=rename_bookmark(editor.view.bookmarks, *names)))


def _play(editor: Editor, goes_on: bool | None) -> str | None:
    (editor.player.pause if goes_on is False else editor.player.play)()
    return None


def _stop(editor: Editor, value: None) -> str | None:
    editor.cancel_work()
    return None


def _resume(editor: Editor, value: None) -> str | None:
    editor.resume_work()
    return None


PICTURE = (
    Gesture("Click", "Select the object"),
    Gesture("Drop", "A material of the library onto an object"),
    Gesture("Alt click", "Show the lobe there; Shift Alt drag moves it"),
    Gesture("Shift drag", "Turn the light (also the wheel over its dial)"),
    Operator("show", entry="Panels", script=ScriptKey(Text, "Opens a panel.")),
    Operator("reset_layout", entry="Reset the layout"),
    Operator(
        "view", _choose_view, entry="View transform",
        script=ScriptKey(Text, 'Chooses a view such as `"AgX"`, or goes to a saved one.'),
    ),
    Operator("save_view", _save_view, script=ScriptKey(Text, "Saves the view under a name.")),
    Operator("rename_view", _rename_view),
    Operator("mode", _choose_mode, script=ScriptKey(Text, "Chooses Placement, Orbit or Deform.")),
    Operator(
        "lobe", lambda editor, pixel: editor.do(SetView.of(lobe_pixel=pixel)),
        script=ScriptKey(
            tuple[PictureIndex, PictureIndex], "Shows the selected layer's lobe at a pixel of the picture."
        ),
    ),
    Operator(
        "toggle_orbit", lambda editor, value: _toggle_mode(editor, "orbit"), ("O",),
        "Placement, or Orbit, where the camera moves freely",
    ),
    Operator(
        "toggle_deform", lambda editor, value: _toggle_mode(editor, "deform"), ("Shift O",),
        "Placement, or Deform, where objects bend",
    ),
    Operator(
        "compare", _toggle_comparison, ("C",), "Compare: remember this picture as A, show A | B",
        entry="Compare with now", is_on=lambda context: context.view.compare is not None,
    ),
    Operator(
        "lighting", _choose_lighting, ("K",), "Simple lighting: no shadows, one light, in place again",
        entry="Simple lighting", needs=PLACEMENT, is_on=lambda context: context.view.lighting != "scene",
        script=ScriptKey(Lighting, "Lights Placement's picture as simple previews do, or `\"scene\"`, in place."),
    ),
    Operator(
        "error", lambda editor, value: editor.do(SetView.of(shows_error=not editor.view.shows_error)), ("E",),
        "Show the error, in false colours", entry="Show the error", is_on=lambda context: context.view.shows_error,
    ),
    Operator(
        "alone", keys=("Space",), help="The picture alone; where it is animated, in Deform: play",
        entry="The picture alone",
    ),
    Operator("play", _play),
    Gesture("Ctrl Alt wheel", "Magnify the picture about the mouse"),
    Gesture("Ctrl Alt drag", "Move the magnified picture"),
    Operator(
        "whole", lambda editor, value: editor.do(SetView.of(fit=True)), ("0",),
        "Fit the picture, show it pixel for pixel", "0   1", entry="Fit the picture",
        is_on=lambda context: context.view.fit,
    ),
    Operator(
        "pixels", lambda editor, value: editor.do(SetView.of(fit=False, zoom=1.0, centre=(0.5, 0.5))), ("1",),
        entry="Pixel for pixel", is_on=is_pixel_for_pixel,
    ),
    Operator(
        "resolution", lambda editor, resolution: editor.camera_history.resize(resolution), entry="Resolution…",
        needs=SCENE,
    ),
    Operator(
        "darker", lambda editor, value: _expose(editor, -STOPS_A_PRESS), ("[",),
        "Exposure down, up; the brush smaller, larger", listed_keys="[  ]", repeats=True,
    ),
    Operator("brighter", lambda editor, value: _expose(editor, STOPS_A_PRESS), ("]",), repeats=True),
    Operator("solo", _solo, ("/",), "See the selected layer alone, or all again", needs=LAYER),
    Operator("stop", _stop),
    Operator("resume", _resume),
    Operator("wait", script=ScriptKey(AwaitedPicture, "Waits for a picture, or for its error estimate.")),
    Operator(
        "assert_error_below",
        script=ScriptKey(
            Annotated[Number, Field(gt=0.0)], "Fails where an edit has more than this relRMSE left to show."
        ),
    ),
)  # fmt: skip

HELP = (
    Gesture("Alt", "The menus; Alt F, E, A, V, L, H: one of them"),
    Operator(
        "help", lambda editor, value: editor.do(SetView.of(show_shortcuts=not editor.view.show_shortcuts)),
        ("?", "F1"), "This list", entry="Shortcuts", is_on=lambda context: context.view.show_shortcuts,
    ),
)  # fmt: skip
