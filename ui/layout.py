"""The docking of the panels: default places for any size and scale of the window, and those that the user gave them.

The picture is the middle and gets what the others leave. A window has one of three forms: wide, with a column on either
side; compact, with one column and panels in tabs; small, with all panels in tabs beside the picture. Each form has its
own stored layout, so that a window made small for a moment is as it was when it is large again.

The file of the layouts is imgui's own text for each form, under lines that name the version and scale it was made for;
at another scale, where its pixels would be wrong, the defaults are built again. It is only a convenience: whatever is
wrong with it, the window opens with the default layout.
"""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from pathlib import Path
from typing import Literal, cast, get_args

from imgui_bundle import ImVec2, imgui

from app.document.view_state import OpenPanel
from app.editor.editor import Editor
from app.system.atomic import replacing

LEFT_WIDTH, RIGHT_WIDTH, COMPACT_WIDTH = 216.0, 290.0, 250.0
CURVE_HEIGHT, COMPACT_CURVE_HEIGHT = 240.0, 216.0
LIGHT_HEIGHT, ACCURACY_HEIGHT = 242.0, 300.0
LIBRARY_SHARE, COMPACT_OBJECTS_SHARE, SMALL_SHARE = 0.56, 0.42, 0.5
LEAST_WIDE, LEAST_COMPACT = (1020.0, 640.0), (600.0, 440.0)
LEAST_SIZE = (400, 300)
DOCK_SPACE = "insitu.dock"

Form = Literal["wide", "compact", "small"]
_SELECTED = re.compile(r"Selected=0x([0-9A-F]+)")


@dataclass(frozen=True)
class Panel:
    """A dockable window: `key` in the view's table of open panels, `title` on its tab."""

    key: str
    title: str

    @property
    def window(self) -> str:
        """The name that imgui knows it by; the title may change without losing its place."""
        return f"{self.title}###{self.key}"


OBJECTS = Panel("objects", "Objects")
VIEWPORT = Panel("viewport", "Picture")
CURVE = Panel("curve", "Curve")
MATERIAL = Panel("material", "Material")
LIGHT = Panel("light", "Light")
ACCURACY = Panel("accuracy", "Accuracy")
PLAN = Panel("plan", "Plan")
LIBRARY = Panel("library", "Library")
BRDF = Panel("brdf", "BRDF")
PANELS = (OBJECTS, VIEWPORT, CURVE, MATERIAL, LIGHT, ACCURACY, PLAN, BRDF, LIBRARY)
# The panels that are in front of the others in their dock at first; and those that are folded away at first.
IN_FRONT: dict[Form, tuple[str, ...]] = {
    "wide": (ACCURACY.key,), "compact": (OBJECTS.key, MATERIAL.key, CURVE.key), "small": (),
}  # fmt: skip
FOLDED: dict[Form, frozenset[str]] = {
    "wide": frozenset(), "compact": frozenset(), "small": frozenset(p.key for p in PANELS) - {VIEWPORT.key},
}  # fmt: skip


def form_of(size: tuple[float, float], scale: float) -> Form:
    """The form of a window of this size in framebuffer pixels."""
    width, height = size[0] / scale, size[1] / scale
    if width >= LEAST_WIDE[0] and height >= LEAST_WIDE[1]:
        return "wide"
    return "compact" if width >= LEAST_COMPACT[0] and height >= LEAST_COMPACT[1] else "small"


def begin_dock_space(form: Form, scale: float, rebuild: bool) -> None:
    """Fill the area between menu and status bar with the dock space; build the default where there is no layout yet."""
    viewport = imgui.get_main_viewport()
    identity = imgui.get_id(DOCK_SPACE)
    if rebuild or imgui.internal.dock_builder_get_node(identity) is None:
        build_default(identity, viewport.work_size, form, scale)
    # The window is cleared with the backdrop and the panels fill it: a third layer over all of it would cost a software
    # rasterizer a fifth of the frame.
    imgui.push_style_color(imgui.Col_.window_bg, 0)
    imgui.dock_space_over_viewport(identity, viewport)
    imgui.pop_style_color()


def build_default(identity: int, size: ImVec2, form: Form, scale: float) -> None:
    """Dock all panels as the form has them by default."""
    builder = imgui.internal
    builder.dock_builder_remove_node(identity)
    builder.dock_builder_add_node(identity, int(imgui.internal.DockNodeFlagsPrivate_.dock_space))
    builder.dock_builder_set_node_size(identity, size)
    places = {"wide": _wide, "compact": _compact, "small": _small}[form](identity, scale)
    for panel in PANELS:
        builder.dock_builder_dock_window(panel.window, places[panel])
    picture = builder.dock_builder_get_node(places[VIEWPORT])
    hide_single_tab = imgui.DockNodeFlags_.auto_hide_tab_bar
    picture.set_local_flags(int(picture.local_flags) | int(hide_single_tab))
    builder.dock_builder_finish(identity)


def _wide(root: int, scale: float) -> dict[Panel, int]:
    """Objects over library and BRDF; the picture over the curve; right material, light, and accuracy with the plan."""
    left, rest = _split(root, imgui.Dir.left, LEFT_WIDTH * scale, 0.25)
    right, middle = _split(rest, imgui.Dir.right, RIGHT_WIDTH * scale, 0.4)
    curve, picture = _split(middle, imgui.Dir.down, CURVE_HEIGHT * scale, 0.36)
    accuracy, upper = _split(right, imgui.Dir.down, ACCURACY_HEIGHT * scale, 0.45)
    light, material = _split(upper, imgui.Dir.down, LIGHT_HEIGHT * scale, 0.5)
    library, objects = _split(left, imgui.Dir.down, LIBRARY_SHARE * _size(left).y)
    return {
        OBJECTS: objects, LIBRARY: library, BRDF: library, VIEWPORT: picture, CURVE: curve, MATERIAL: material,
        LIGHT: light, ACCURACY: accuracy, PLAN: accuracy,
    }  # fmt: skip


def _compact(root: int, scale: float) -> dict[Panel, int]:
    """The picture over curve and plan; right objects, library and BRDF over material, light and accuracy."""
    right, middle = _split(root, imgui.Dir.right, COMPACT_WIDTH * scale, 0.4)
    curve, picture = _split(middle, imgui.Dir.down, COMPACT_CURVE_HEIGHT * scale, 0.42)
    upper, lower = _split(right, imgui.Dir.up, COMPACT_OBJECTS_SHARE * _size(right).y)
    return {
        OBJECTS: upper, LIBRARY: upper, BRDF: upper, VIEWPORT: picture, CURVE: curve, MATERIAL: lower, LIGHT: lower,
        ACCURACY: lower, PLAN: curve,
    }  # fmt: skip


def _small(root: int, scale: float) -> dict[Panel, int]:
    """The picture beside all others."""
    others, picture = _split(root, imgui.Dir.right, SMALL_SHARE * _size(root).x)
    return {**dict.fromkeys(PANELS, others), VIEWPORT: picture}


def _split(node: int, side: imgui.Dir, extent: float, most: float = 1.0) -> tuple[int, int]:
    """Split a node; returns (the new node at `side`, of so many pixels or at most that share, the rest)."""
    size = _size(node)
    whole = size.x if side in (imgui.Dir.left, imgui.Dir.right) else size.y
    split = imgui.internal.dock_builder_split_node(node, side, min(extent / max(whole, 1.0), most))
    return split.id_at_dir, split.id_at_opposite_dir


def _size(node: int) -> ImVec2:
    return imgui.internal.dock_builder_get_node(node).size


def is_behind(panel: Panel) -> bool:
    """Whether another panel of its dock is in front of it."""
    window = imgui.internal.find_window_by_name(panel.window)
    return window is not None and bool(window.hidden)


def chosen_tabs(places: str) -> tuple[str, ...]:
    """Keys of the panels that imgui's text of their places has in front of others."""
    chosen = {int(number, 16) for number in _SELECTED.findall(places)}
    windows = {panel: imgui.internal.find_window_by_name(panel.window) for panel in PANELS if shares_place(panel)}
    return tuple(panel.key for panel, window in windows.items() if window.tab_id in chosen)


def shares_place(panel: Panel) -> bool:
    """Whether other panels are in its dock."""
    window = imgui.internal.find_window_by_name(panel.window)
    node = None if window is None else window.dock_node
    return node is not None and len(node.windows) > 1


def closed(panel: Panel) -> OpenPanel:
    """The command for a panel whose close button was pressed."""
    return OpenPanel(panel.key, False)


VERSION = 5
_FORM = re.compile(r"^; form (\w+) folded ?(.*)\n", re.MULTILINE)


@dataclass
class LayoutMemory:
    """`places` are imgui's texts by form, `folded` keys of the panels that are closed. `file` None: nothing is
    stored."""

    file: Path | None
    scale: float
    places: dict[Form, str] = field(default_factory=dict)
    folded: dict[Form, frozenset[str]] = field(default_factory=dict)

    @classmethod
    def read(cls, file: Path | None, scale: float) -> LayoutMemory:
        """The content of the file, empty where it is missing, damaged, or of another version or scale."""
        memory = cls(file, scale)
        try:
            text = "" if file is None else file.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError):
            return memory
        first, _, body = text.partition("\n")
        if first != memory._first_line:
            return memory
        _, *parts = _FORM.split(body)
        for name, folded, places in zip(parts[::3], parts[1::3], parts[2::3], strict=True):
            if name in get_args(Form):
                memory.places[cast(Form, name)] = places
                memory.folded[cast(Form, name)] = frozenset(folded.split())
        return memory

    def keep(self, form: Form, places: str, folded: frozenset[str]) -> None:
        """Note the window's layout and write it; a folder that cannot be written to costs only the memory.

        It does not wait for the disk: this runs between two frames, and a lost layout is built again.
        """
        self.places[form], self.folded[form] = places, folded
        if self.file is None:
            return
        parts = (f"; form {name} folded {' '.join(sorted(self.folded[name]))}\n{text}"
                 for name, text in self.places.items())  # fmt: skip
        try:
            with replacing(self.file, durable=False, private=True) as file:
                file.write(f"{self._first_line}\n{''.join(parts)}".encode())
        except OSError:
            return

    def rescale(self, scale: float) -> None:
        """Forget places whose pixels are another screen's."""
        self.scale, self.places = scale, {}

    @property
    def _first_line(self) -> str:
        return f"; insitu layout {VERSION} scale {self.scale:.2f}"


# Frames until imgui has docked its windows, and their tabs know which others are in the same dock.
SETTLING = 3
# This many frames before that, they are docked where a remembered text has them.
SETTLED_IN = 1


class Docking:
    """Follows the window's form, and remembers what the user has moved and folded away."""

    def __init__(self, editor: Editor, file: Path | None, scale: float) -> None:
        self.form: Form = "wide"
        self._editor = editor
        self._memory = LayoutMemory.read(file, scale)
        self._is_placed = False
        self._unsettled = 0
        self._rebuild = False
        self._recalled = ""
        self._in_front: tuple[str, ...] = ()
        self._behind_picture: tuple[str, ...] | None = None

    def take_size(self, size: tuple[int, int], scale: float) -> None:
        """Before a frame: if the window has another form than before, restore the panels of that form."""
        form = form_of(size, scale)
        if self._is_placed and form == self.form:
            return
        if self._is_placed:
            self.keep()
        self.form, self._is_placed = form, True
        places = self._memory.places.get(form)
        self._rebuild = places is None
        self._unsettled = SETTLING
        self._recalled = "" if places is None or form == "small" else places
        self._in_front = ()
        if places is not None:
            imgui.load_ini_settings_from_memory(places)
        self._fold(self._memory.folded.get(form, FOLDED[form]))

    @property
    def is_settling(self) -> bool:
        """Whether the panels' new places show only in the coming frames."""
        return self._unsettled > 0

    def rescale(self, scale: float) -> None:
        """Adopt another scale of the screen, which changes every place."""
        self._memory.rescale(scale)
        self._rebuild = True

    def make_room(self, front: tuple[str, ...]) -> None:
        """In a small window there is room for one panel beside the picture: the one that comes to the front."""
        if self.form == "small" and front:
            self._fold(FOLDED["small"] - {*front})

    def begin_space(self, scale: float, alone: bool = False) -> tuple[str, ...]:
        """Begin the space that panels dock in; where their places are new, or they come back after the picture was
        alone, return those that are to be in front.

        That is for the next pass, when the panels are there: of those that appear together the last one would be in
        front. One per pass: of panels that were docked elsewhere a frame ago imgui raises only the last that it is
        given.
        """
        begin_dock_space(self.form, scale, self._rebuild)
        rebuilt, self._rebuild = self._rebuild, False
        self._unsettled = SETTLING if rebuilt else max(self._unsettled - 1, 0)
        if rebuilt:
            self._recalled, self._in_front = "", IN_FRONT[self.form]
        if alone and self._behind_picture is None:
            self._behind_picture = chosen_tabs(imgui.save_ini_settings_to_memory())
        elif not alone and self._behind_picture is not None:
            self._in_front, self._behind_picture = self._in_front or self._behind_picture, None
            self._unsettled = SETTLING
        if self._in_front:
            first, *others = self._in_front
            self._in_front = tuple(others)
            return (first,)
        if self._recalled and self._unsettled == SETTLED_IN:
            recalled, self._recalled = self._recalled, ""
            return chosen_tabs(recalled)
        return ()

    def reset(self) -> None:
        """Put all panels into the default layout."""
        self._rebuild = True
        self._fold(FOLDED[self.form])

    def remember(self) -> None:
        """After a frame: write what has changed, when imgui asks for it."""
        if imgui.get_io().want_save_ini_settings:
            self.keep()
            imgui.get_io().want_save_ini_settings = False

    def keep(self) -> None:
        """Write the layout of the panels."""
        if self._is_placed:
            folded = (panel.key for panel in PANELS if not self._editor.view.panel_open(panel.key))
            self._memory.keep(self.form, imgui.save_ini_settings_to_memory(), frozenset(folded))

    def _fold(self, folded: frozenset[str]) -> None:
        for panel in PANELS:
            self._editor.do(OpenPanel(panel.key, panel.key not in folded))
