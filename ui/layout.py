"""Where the panels are docked: a default for any size and scale, and its memory in a file.

The remembered layout is imgui's own text with a first line that says for which scale it was made; at another scale,
where its pixels would be wrong, the default is built again. The file is only a convenience: whatever is wrong with it,
the window opens with the default layout.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from imgui_bundle import ImVec2, imgui

from app.atomic import write_atomically
from app.view_state import OpenPanel

VERSION = 4
LEFT_WIDTH = 216.0
LIBRARY_SHARE = 0.56
RIGHT_WIDTH = 306.0
CURVE_SHARE = 0.41
LIGHT_HEIGHT, ACCURACY_HEIGHT = 242.0, 300.0
DOCK_SPACE = "insitu.dock"


@dataclass(frozen=True)
class Panel:
    """A dockable window: `key` in the view's table of open panels, `title` on its tab."""

    key: str
    title: str

    @property
    def window(self) -> str:
        """The name imgui knows it by; the title may change without losing its place."""
        return f"{self.title}###{self.key}"


OBJECTS = Panel("objects", "Objects")
VIEWPORT = Panel("viewport", "Picture")
CURVE = Panel("curve", "Curve")
MATERIAL = Panel("material", "Material")
LIGHT = Panel("light", "Light")
ACCURACY = Panel("accuracy", "Speed and accuracy")
LIBRARY = Panel("library", "Library")
BRDF = Panel("brdf", "BRDF")
PANELS = (OBJECTS, VIEWPORT, CURVE, MATERIAL, LIGHT, ACCURACY, BRDF, LIBRARY)


def begin_dock_space(scale: float, rebuild: bool) -> None:
    """Fill what menu and status bar leave with the dock space; build the default where there is no layout yet."""
    viewport = imgui.get_main_viewport()
    identity = imgui.get_id(DOCK_SPACE)
    if rebuild or imgui.internal.dock_builder_get_node(identity) is None:
        build_default(identity, viewport.work_size, scale)
    # The window is cleared with the backdrop and the panels fill it: a third layer over all of it would cost a software
    # rasterizer a fifth of the frame.
    imgui.push_style_color(imgui.Col_.window_bg, 0)
    imgui.dock_space_over_viewport(identity, viewport)
    imgui.pop_style_color()


def build_default(identity: int, size: ImVec2, scale: float) -> None:
    """Objects over library and BRDF; the picture over the curve; material, light and accuracy in a column right."""
    builder = imgui.internal
    builder.dock_builder_remove_node(identity)
    builder.dock_builder_add_node(identity, int(imgui.internal.DockNodeFlagsPrivate_.dock_space))
    builder.dock_builder_set_node_size(identity, size)
    left, rest = _split(identity, imgui.Dir.left, min(LEFT_WIDTH * scale / size.x, 0.25))
    right, middle = _split(rest, imgui.Dir.right, min(RIGHT_WIDTH * scale / (size.x - LEFT_WIDTH * scale), 0.4))
    curve, picture = _split(middle, imgui.Dir.down, CURVE_SHARE)
    column = imgui.internal.dock_builder_get_node(right).size.y
    accuracy, upper = _split(right, imgui.Dir.down, min(ACCURACY_HEIGHT * scale / column, 0.45))
    light, material = _split(
        upper, imgui.Dir.down, min(LIGHT_HEIGHT * scale / (column - ACCURACY_HEIGHT * scale), 0.5)
    )
    library, objects = _split(left, imgui.Dir.down, LIBRARY_SHARE)
    places = (objects, picture, curve, material, light, accuracy, library, library)
    for panel, node in zip(PANELS, places, strict=True):
        builder.dock_builder_dock_window(panel.window, node)
    picture_node = builder.dock_builder_get_node(picture)
    hide_single_tab = imgui.DockNodeFlags_.auto_hide_tab_bar
    picture_node.set_local_flags(int(picture_node.local_flags) | int(hide_single_tab))
    builder.dock_builder_finish(identity)


def _split(node: int, side: imgui.Dir, share: float) -> tuple[int, int]:
    """(the new node at `side`, what remains)."""
    split = imgui.internal.dock_builder_split_node(node, side, share)
    return split.id_at_dir, split.id_at_opposite_dir


def load(file: Path | None, scale: float) -> bool:
    """Restore the layout before the first frame. Whether there was one for this version and scale."""
    if file is None:
        return False
    try:
        first, _, body = file.read_text(encoding="utf-8").partition("\n")
    except (OSError, UnicodeDecodeError):
        return False
    if first != _first_line(scale):
        return False
    imgui.load_ini_settings_from_memory(body)
    return True


def save(file: Path | None, scale: float) -> None:
    """Remember the layout; a folder that cannot be written to costs nothing but the memory."""
    if file is None:
        return
    text = f"{_first_line(scale)}\n{imgui.save_ini_settings_to_memory()}"
    try:
        write_atomically(file, text.encode())
    except OSError:
        return


def _first_line(scale: float) -> str:
    return f"; insitu layout {VERSION} scale {scale:.2f}"


def is_behind(panel: Panel) -> bool:
    """Whether another panel that shares its place is before it."""
    window = imgui.internal.find_window_by_name(panel.window)
    return window is not None and bool(window.hidden)


def closed(panel: Panel) -> OpenPanel:
    """The command for a panel whose close button was pressed."""
    return OpenPanel(panel.key, False)
