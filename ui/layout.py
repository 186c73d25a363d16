"""The default docking of the panels, for any size and scale of the window.

The picture is the middle and gets what the others leave. A window has one of three forms: wide, with a column on either
side; compact, with one column and panels in tabs; small, with all panels in tabs beside the picture. Each form has its
own stored layout (`ui.layout_memory`), so that a window made small for a moment is as it was when it is large again.
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from typing import Literal

from imgui_bundle import ImVec2, imgui

from app.document.view_state import OpenPanel

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
