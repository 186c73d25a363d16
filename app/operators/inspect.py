"""Operators that inspect the picture: its channels, what is clipped, its values, and how it differs from another."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from pathlib import Path
from typing import Annotated

from pydantic import Field

from app.document.view_state import DIFFERENCES, MOST_PROBES, PICTURE_CHANNELS, Difference, PictureChannel, SetView
from app.editor.editor import Editor
from app.operators.edits import PictureIndex
from app.operators.operator import SCENE, Need, Operator, OperatorContext, ScriptKey, ValueRecord
from engine.core.colour import ConfigView
from engine.core.errors import InsituError
from engine.render.crop import Crop
from engine.scene.description import Text

FALSE_COLOUR = "false_colour"
_KEYS = dict(zip(PICTURE_CHANNELS, ("Ctrl 2", "Ctrl 3", "Ctrl 4", "Ctrl 5", "Ctrl 6", "Ctrl 7"), strict=True))
_HELP = {"colour": "All channels; R, G, B, A, luminance"}


def _choose_channel(editor: Editor, channel: PictureChannel) -> str | None:
    return editor.do(SetView.of(picture_channel=channel))


def _toggle_channel(channel: PictureChannel, editor: Editor, value: None) -> str | None:
    """Show a channel alone, or all again where it is shown already."""
    return _choose_channel(editor, "colour" if editor.view.picture_channel == channel else channel)


def _is_shown(channel: PictureChannel, context: OperatorContext) -> bool:
    return context.view.picture_channel == channel


def _toggle_zebra(editor: Editor, shown: bool | None) -> str | None:
    return editor.do(SetView.of(zebra=not editor.view.zebra if shown is None else shown))


def _toggle_false_colour(editor: Editor, value: None) -> str | None:
    """Show luminance in stops, or the view that was shown before."""
    view = editor.view
    if view.tone_mapping == FALSE_COLOUR:
        return editor.do(SetView.of(tone_mapping=view.view_before))
    return editor.do(SetView.of(tone_mapping=FALSE_COLOUR, view_before=view.tone_mapping))


def _reset_exposure(editor: Editor, value: None) -> str | None:
    return editor.do(SetView.of(exposure=0.0, gamma=1.0))


Side = Annotated[float, Field(ge=0.0, le=1.0)]


def _set_crop(editor: Editor, sides: Sequence[float]) -> str | None:
    return editor.do(SetView.of(crop=Crop.checked(sides) if sides else None))


def _pin_probes(editor: Editor, pixels: Sequence[tuple[int, int]]) -> str | None:
    """Pin pixels of the picture as it is now, in place of others."""
    width, height = editor.view.resolution or editor.camera_history.own_resolution
    return editor.do(SetView.of(probes=tuple(((x + 0.5) / width, (y + 0.5) / height) for x, y in pixels)))


class ConfiguredView(ValueRecord):
    config: Annotated[Text, Field(description="A configuration of OpenColorIO, or `ocio://default`.")]
    display: Annotated[str, Field(description="One of its displays; else its default.")] = ""
    view: Annotated[str, Field(description="A view of that display; else its default.")] = ""
    look: Annotated[str, Field(description="One of its looks, applied before the view.")] = ""


def _open_config(editor: Editor, value: ConfiguredView) -> str | None:
    editor.colours.open(ConfigView(value.config, value.display, value.view, value.look))
    return None


STORED = Need("choose a stored picture, or store one first", lambda context: bool(context.view.stored))


def _compare_with(editor: Editor, name: str) -> str | None:
    return editor.stored.compare_with(name)


def _compare_file(editor: Editor, file: str) -> str | None:
    editor.stored.load(Path(file))
    return None


def _show_difference(editor: Editor, difference: Difference | None) -> str | None:
    """Show this, or what comes next."""
    after = DIFFERENCES[(DIFFERENCES.index(editor.view.difference) + 1) % len(DIFFERENCES)]
    return editor.do(SetView.of(difference=difference or after))


def _remove_stored(editor: Editor, name: str | None) -> str | None:
    """Forget a stored picture; by default the one that is compared."""
    if not (name := name or editor.view.stored):
        raise InsituError(STORED.reason)
    editor.stored.remove(name)
    return None


def channel_operator(channel: PictureChannel) -> str:
    """The name of the operator that shows a channel alone."""
    return f"channel_{channel}"


INSPECT = (
    Operator("open_config", entry="Open a configuration…", help="Open a configuration of OpenColorIO (.ocio, .ocioz)."),
    Operator(
        "ocio", _open_config,
        script=ScriptKey(ConfiguredView, "Shows light through a view of an OpenColorIO configuration: see below."),
    ),
    Operator("values", keys=("Q",), help="Values of the pixel under the mouse", entry="Pixel values"),
    Operator("average", keys=("Alt Q",), help="Mean of 1, 9 or 25 pixels", entry="Mean of more pixels"),
    Operator("copy_values", keys=("Shift Q",), help="Copy them", entry="Copy the pixel's values"),
    *(
        Operator(
            channel_operator(each), partial(_toggle_channel, each), (_KEYS[each],), _HELP.get(each, ""),
            "Ctrl 2 34567" if each == "colour" else "",
            entry="All channels" if each == "colour" else f"{each.capitalize()} alone", is_on=partial(_is_shown, each),
        )
        for each in PICTURE_CHANNELS
    ),
    Operator(
        "picture_channel", _choose_channel,
        script=ScriptKey(PictureChannel, "Shows one channel of the picture alone, or `\"colour\"`."),
    ),
    Operator(
        "zebra", _toggle_zebra, ("Ctrl 8",), "Stripes where the screen clips", entry="Stripes where it clips",
        is_on=lambda context: context.view.zebra,
        script=ScriptKey(bool, "Whether stripes show where colours are at the screen's upper end."),
    ),
    Operator(
        "stops", _toggle_false_colour, ("Ctrl 9",), "Luminance in stops, in false colours",
        entry="Stops in false colours", is_on=lambda context: context.view.tone_mapping == FALSE_COLOUR,
    ),
    Operator(
        "reset_exposure", _reset_exposure, ("\\",), "Exposure and gamma as at first",
        entry="Reset exposure, gamma",
    ),
    Operator("pin_probe", keys=("Shift Alt Q",), help="Pin the pixel, or unpin it", entry="Pin the pixel"),
    Operator(
        "clear_probes", lambda editor, value: editor.do(SetView.of(probes=())), entry="Unpin all pixels",
        needs=Need("pin a pixel first", lambda context: bool(context.view.probes)), help="Remove all pinned pixels.",
    ),
    Operator(
        "probes", _pin_probes,
        script=ScriptKey(
            Annotated[list[tuple[PictureIndex, PictureIndex]], Field(max_length=MOST_PROBES)],
            "Pins pixels of the picture, whose values stay on screen; `[]` removes all.",
        ),
    ),
    Operator("draw_crop", keys=("Ctrl B",), help="Draw a crop; remove it", listed_keys="Ctrl B   Ctrl Alt B",
             entry="Draw a crop", needs=SCENE),
    Operator(
        "clear_crop", lambda editor, value: editor.do(SetView.of(crop=None)), ("Ctrl Alt B",), entry="Remove the crop",
        needs=Need("there is no crop", lambda context: context.view.crop is not None),
    ),
    Operator(
        "crop", _set_crop,
        script=ScriptKey(
            Annotated[list[Side], Field(min_length=0, max_length=4)],
            "The part that is inspected and saved: left, upper, right, lower, in fractions; `[]` for all.",
        ),
    ),
    Operator(
        "store_picture", keys=("Shift C",), help="Store the picture, to compare it", entry="Store the picture",
        needs=SCENE, script=ScriptKey(Text, "Stores the picture under a name, and compares later ones with it."),
    ),
    Operator(
        "compare_file", _compare_file, entry="Compare with a file…", needs=SCENE,
        help="Compare with a picture of the same size: EXR, HDR, PNG, JPEG, WebP.",
        script=ScriptKey(Text, "Compares the picture with one from a file: EXR, HDR, PNG, JPEG, WebP."),
    ),
    Operator(
        "compare_with", _compare_with, entry="Compare with",
        script=ScriptKey(str, "Compares the picture with a stored one, by its name; `\"\"` ends the comparison."),
    ),
    Operator(
        "difference", _show_difference, ("Alt C",), "Stored, split, the difference", entry="Show the next of both",
        needs=STORED,
        script=ScriptKey(Difference, "What is shown of the picture and the stored one, or how they differ."),
    ),
    Operator(
        "remove_stored", _remove_stored, entry="Remove the stored picture",
        help="Forget the stored picture that is compared.", script=ScriptKey(Text, "Forgets a stored picture."),
    ),
    Operator("scopes", keys=("Ctrl 0",), help="Histogram and waveforms", entry="Histogram and waveforms"),
    Operator("zoom_in", keys=("Ctrl =",), help="Magnify the picture, and back", listed_keys="Ctrl = -", repeats=True,
             entry="Magnify"),
    Operator("zoom_out", keys=("Ctrl -",), repeats=True, entry="Less"),
)  # fmt: skip
