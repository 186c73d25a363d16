"""The theme of the window: greys without tint, one accent, a real font, ample spacing.

Colour is judged beside this interface, so every surface is an exact grey (r = g = b) and the single accent, an amber,
is limited to thin strokes and small areas. Red, green and blue in the curve editor mean colour channels, nothing else.

All sizes are given for a scale of 1 and multiplied once, by `Theme.px`; the window works in framebuffer pixels
throughout, so glyphs and hairlines stay crisp at any scale (rejected: logical units with a framebuffer scale, which
leaves half-pixel lines).
"""

from __future__ import annotations

from dataclasses import dataclass
from importlib.util import find_spec
from pathlib import Path

from imgui_bundle import ImVec2, ImVec4, imgui

Colour = tuple[float, float, float, float]

BODY_SIZE = 15.0
SMALL_SIZE = 13.0


def grey(value: int, alpha: float = 1.0) -> Colour:
    """An exact grey, `value` in 0..255."""
    return (value / 255.0, value / 255.0, value / 255.0, alpha)


def with_alpha(colour: Colour, alpha: float) -> Colour:
    """The same colour with another opacity in [0, 1]."""
    return (colour[0], colour[1], colour[2], alpha)


def pack(colour: Colour) -> int:
    """A colour as the 32-bit value that draw lists take."""
    return imgui.get_color_u32(ImVec4(*colour))


WELL = grey(20)
BACKDROP = grey(27)
SURFACE = grey(36)
CHROME = grey(29)
FRAME = grey(50)
FRAME_HOVER = grey(62)
FRAME_ACTIVE = grey(72)
LINE = grey(56)
GRID = grey(44)
GRID_STRONG = grey(62)
TEXT = grey(222)
TEXT_SOFT = grey(160)
TEXT_FAINT = grey(112)
ACCENT: Colour = (0.910, 0.655, 0.260, 1.0)
GOOD: Colour = (0.500, 0.760, 0.500, 1.0)
BAD: Colour = (0.930, 0.420, 0.360, 1.0)
CHANNELS: tuple[Colour, Colour, Colour] = (
    (0.925, 0.380, 0.350, 1.0),
    (0.455, 0.780, 0.415, 1.0),
    (0.390, 0.600, 0.960, 1.0),
)


class Icon:
    """Glyphs of Font Awesome 6 Free Solid by their meaning here."""

    VISIBLE = "\uf06e"
    HIDDEN = "\uf070"
    FROZEN = "\uf2dc"
    SOLO = "\uf192"
    LOCKED = "\uf023"
    EDITABLE = "\uf304"
    EMITTER = "\uf0eb"
    UNDO = "\uf0e2"
    REDO = "\uf01e"
    COMPARE = "\uf0db"
    CAMERA = "\uf030"
    HELP = "\uf128"
    RESET = "\uf2ea"
    DELETE = "\uf2ed"
    UP = "\uf077"
    DOWN = "\uf078"
    ADD = "\u002b"
    COLLAPSE = "\uf066"
    FIT = "\uf31e"
    HORIZONTAL = "\uf337"
    VERTICAL = "\uf338"
    DIAGONAL = "\uf0b2"
    WARNING = "\uf071"
    CLOSE = "\uf00d"
    RESUME = "\uf04b"
    PAUSE = "\uf04c"
    LOOP = "\uf021"
    CHANGED = "\uf111"
    CLOCK = "\uf017"
    MEMORY = "\uf538"
    IMAGE = "\uf03e"
    PENCIL = "\uf303"
    POINTS = "\uf55b"
    COPY = "\uf0c5"
    LINK = "\uf0c1"
    REPORT = "\uf05a"
    GROUP = "\uf247"
    MAGNET = "\uf076"


@dataclass
class Fonts:
    """The loaded fonts; icons are merged into the regular and the bold face."""

    regular: imgui.ImFont
    bold: imgui.ImFont


def fonts_folder() -> Path:
    """Folder of the fonts that imgui-bundle installs. Raises FileNotFoundError where the package lacks them."""
    spec = find_spec("imgui_bundle")
    if spec is None or spec.origin is None:
        raise FileNotFoundError("imgui-bundle is not installed; run `make setup`")
    folder = Path(spec.origin).parent / "assets" / "fonts"
    if not (folder / "Roboto" / "Roboto-Regular.ttf").is_file():
        raise FileNotFoundError(f"{folder}: Roboto-Regular.ttf is missing; reinstall imgui-bundle")
    return folder


def load_fonts() -> Fonts:
    """Add Roboto with icons to the current context's atlas. Glyphs are rasterised on demand at the size drawn."""
    folder = fonts_folder()
    atlas = imgui.get_io().fonts

    def face(name: str) -> imgui.ImFont:
        font = atlas.add_font_from_file_ttf(str(folder / "Roboto" / name), BODY_SIZE)
        icons = imgui.ImFontConfig()
        icons.merge_mode = True
        icons.glyph_min_advance_x = BODY_SIZE * 1.1
        icons.glyph_offset = ImVec2(0.0, 0.5)
        atlas.add_font_from_file_ttf(str(folder / "Font_Awesome_6_Free-Solid-900.otf"), BODY_SIZE * 0.86, icons)
        return font

    return Fonts(regular=face("Roboto-Regular.ttf"), bold=face("Roboto-Bold.ttf"))


@dataclass
class Theme:
    """Fonts and scale in use. `px` converts a design size to whole framebuffer pixels."""

    fonts: Fonts
    scale: float = 1.0

    def px(self, size: float) -> float:
        """`size` at scale 1, in framebuffer pixels, rounded."""
        return float(round(size * self.scale))

    def push_bold(self) -> None:
        """Use the bold font of headings. Ends with imgui.pop_font()."""
        imgui.push_font(self.fonts.bold, BODY_SIZE)


def apply(scale: float) -> Theme:
    """Load fonts into the current imgui context and set every colour and size of its style."""
    theme = Theme(load_fonts(), scale)
    set_style(scale)
    return theme


WINDOW_PADDING = ImVec2(12, 10)


def set_style(scale: float) -> None:
    """Set colours and sizes for `scale` (1 at 96 dpi); may be called again when a window moves to another screen."""
    style = imgui.get_style()
    _set_sizes(style)
    style.scale_all_sizes(scale)
    style.font_size_base = BODY_SIZE
    style.font_scale_dpi = scale
    _set_colours(style)


def _set_sizes(style: imgui.Style) -> None:
    style.window_padding = WINDOW_PADDING
    style.frame_padding = ImVec2(8, 4)
    style.item_spacing = ImVec2(8, 5)
    style.item_inner_spacing = ImVec2(6, 5)
    style.cell_padding = ImVec2(4, 3)
    style.indent_spacing = 16
    style.scrollbar_size = 10
    style.grab_min_size = 9
    style.window_border_size = 0
    style.child_border_size = 0
    style.popup_border_size = 1
    style.frame_border_size = 0
    style.tab_border_size = 0
    style.tab_bar_border_size = 0
    style.tab_bar_overline_size = 2
    style.docking_separator_size = 3
    style.docking_node_has_close_button = False
    style.tab_close_button_min_width_selected = 0.0
    style.tab_close_button_min_width_unselected = 0.0
    style.window_rounding = 6
    style.child_rounding = 4
    style.frame_rounding = 4
    style.popup_rounding = 6
    style.grab_rounding = 3
    style.tab_rounding = 4
    style.scrollbar_rounding = 5
    style.window_menu_button_position = imgui.Dir.none
    style.disabled_alpha = 0.42
    style.hover_stationary_delay = 0.15
    style.hover_delay_short = 0.35
    style.hover_delay_normal = 0.6


def _set_colours(style: imgui.Style) -> None:
    col = imgui.Col_
    clear: Colour = (0.0, 0.0, 0.0, 0.0)
    table: dict[imgui.Col_, Colour] = {
        col.text: TEXT,
        col.text_disabled: TEXT_FAINT,
        col.window_bg: SURFACE,
        col.child_bg: clear,
        col.popup_bg: grey(44, 0.98),
        col.border: grey(70),
        col.border_shadow: clear,
        col.frame_bg: FRAME,
        col.frame_bg_hovered: FRAME_HOVER,
        col.frame_bg_active: FRAME_ACTIVE,
        col.title_bg: CHROME,
        col.title_bg_active: CHROME,
        col.title_bg_collapsed: CHROME,
        col.menu_bar_bg: CHROME,
        col.scrollbar_bg: clear,
        col.scrollbar_grab: grey(70),
        col.scrollbar_grab_hovered: grey(88),
        col.scrollbar_grab_active: grey(104),
        col.check_mark: ACCENT,
        col.slider_grab: grey(150),
        col.slider_grab_active: ACCENT,
        col.button: FRAME,
        col.button_hovered: FRAME_HOVER,
        col.button_active: FRAME_ACTIVE,
        col.header: grey(58),
        col.header_hovered: grey(54),
        col.header_active: grey(64),
        col.separator: LINE,
        col.separator_hovered: with_alpha(ACCENT, 0.6),
        col.separator_active: ACCENT,
        col.resize_grip: clear,
        col.resize_grip_hovered: with_alpha(ACCENT, 0.5),
        col.resize_grip_active: ACCENT,
        col.input_text_cursor: ACCENT,
        col.tab: CHROME,
        col.tab_hovered: FRAME,
        col.tab_selected: SURFACE,
        col.tab_selected_overline: clear,
        col.tab_dimmed: CHROME,
        col.tab_dimmed_selected: SURFACE,
        col.tab_dimmed_selected_overline: clear,
        col.docking_preview: with_alpha(ACCENT, 0.35),
        col.docking_empty_bg: BACKDROP,
        col.plot_lines: TEXT_SOFT,
        col.plot_histogram: ACCENT,
        col.text_selected_bg: with_alpha(ACCENT, 0.35),
        col.text_link: ACCENT,
        col.drag_drop_target: ACCENT,
        col.nav_cursor: with_alpha(ACCENT, 0.8),
        col.modal_window_dim_bg: (0.0, 0.0, 0.0, 0.45),
        col.table_header_bg: CHROME,
        col.table_border_strong: LINE,
        col.table_border_light: LINE,
        col.tree_lines: LINE,
    }
    for index, colour in table.items():
        style.set_color_(index, ImVec4(*colour))
