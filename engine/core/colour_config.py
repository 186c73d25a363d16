"""Displays and views of OpenColorIO configurations [OCIO]: of a file, or of those that are built into the library
(``ocio://NAME``).

Our light is linear Rec. 709. Where a configuration has the role ``aces_interchange`` this is converted to ACES2065-1
by Bradford's adaptation and given to it there; where it has not, a space that is called linear Rec. 709 is taken; else
its role ``scene_linear`` is assumed to be linear Rec. 709, and a note says so. A look is applied before the view,
besides those that the view has.

A configuration is a stranger's file: it may name other files, and the library parses all of them natively. The window
therefore has it read by the worker (`read_view`), and gets texts and numbers; commands without a window read it in
their own process. A graphics card draws by the library's own shader, within 1 of 255 of its processor's values. A
software rasterizer would compile ACES for three seconds and then draw 512 x 512 pixels in 50 to 130 ms: it has a table,
as of the built-in views.
"""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from engine.core.colour import BRIGHTEST_SHOWN, ConfigView, rec709_to_aces, tabulated
from engine.core.errors import LoadError
from engine.core.safe_files import read_regular_file, resolved

if TYPE_CHECKING:
    import PyOpenColorIO as ocio

BUILT_IN = "ocio://"
ENDINGS = (".ocio", ".ocioz")
# Of the colours in a table, before they are clipped to those of a screen.
TABLE_RANGE = -1.0, 16.0
MOST_BYTES = 64 * 2**20
# The function of the shader's text: vec4 to vec4.
SHADER_FUNCTION = "configured_view"
INTERCHANGE, SCENE_LINEAR = "aces_interchange", "scene_linear"
_REC709_NAMES = (
    "lin_rec709", "lin_rec709_scene", "Linear Rec.709 (sRGB)", "Linear Rec.709", "lin_srgb", "Linear BT.709",
    "Utility - Linear - sRGB", "Utility - Linear - Rec.709",
)  # fmt: skip


@dataclass(frozen=True)
class ConfigCatalogue:
    """The displays of a configuration with their views, and its looks. note: what was assumed of it, "" for nothing."""

    config: str
    displays: tuple[tuple[str, tuple[str, ...]], ...]
    looks: tuple[str, ...] = ()
    note: str = ""


@dataclass(frozen=True, eq=False)
class ShaderTexture:
    """A texture that a shader samples, by the name of its uniform: values (height, width, n) or (side, side, side,
    n)."""

    sampler: str
    values: NDArray[np.float32]
    is_linear: bool


@dataclass(frozen=True, eq=False)
class ViewShader:
    """A view as GLSL, with the function `SHADER_FUNCTION`, and as a table (`engine.core.colour.tabulated`); all names
    in `view` are the configuration's own."""

    view: ConfigView
    text: str
    textures: tuple[ShaderTexture, ...]
    table: NDArray[np.float16]


def config_name(file: str) -> str:
    """The name of a configuration: the full path of a file, or that of one that is built in."""
    return file if file.startswith(BUILT_IN) else str(resolved(Path(file)))


def read_view(view: ConfigView) -> tuple[ConfigCatalogue, ViewShader]:
    """The catalogue of a view's configuration, and its shader; what the view leaves open is the configuration's
    default. Raises LoadError."""
    config = _load(view.config)
    catalogue = catalogue_of(config, view.config)
    chosen = _resolved(catalogue, config, view)
    return catalogue, _shader(config, chosen)


def resolve_view(view: ConfigView) -> ConfigView:
    """The view with the configuration's own names, and its defaults in place of what is left open; `view` may be
    written "DISPLAY: VIEW". Raises LoadError."""
    config = _load(view.config)
    return _resolved(catalogue_of(config, view.config), config, view)


def config_transform(radiance: NDArray[np.floating], view: ConfigView) -> NDArray[np.float32]:
    """Linear Rec. 709 radiance (..., 3) as the view's display values in [0, 1]. Raises LoadError."""
    return np.clip(_transformed(_cpu_processor(view), radiance), 0.0, 1.0)


def _transformed(processor: ocio.CPUProcessor, radiance: NDArray[np.floating]) -> NDArray[np.float32]:
    """The same in any range: a table of what is clipped afterwards is right between its points, too."""
    values = np.clip(np.nan_to_num(radiance, nan=0.0), 0.0, BRIGHTEST_SHOWN)
    pixels = np.array(values, np.float32, order="C").reshape(-1, 3)
    if len(pixels):
        processor.applyRGB(pixels)
    return np.clip(np.nan_to_num(pixels, nan=0.0), *TABLE_RANGE).reshape(radiance.shape)


def catalogue_of(config: ocio.Config, name: str) -> ConfigCatalogue:
    """What a configuration offers. Raises LoadError where it has nothing to show light with."""
    displays = tuple((display, tuple(config.getViews(display))) for display in config.getDisplays())
    displays = tuple(each for each in displays if each[1])
    if not displays:
        raise LoadError(name, "displays", "none", "at least one display with a view")
    _, note = _source(config, name)
    return ConfigCatalogue(name, displays, tuple(config.getLookNames()), note)


def _load(name: str) -> ocio.Config:
    """A configuration. Raises LoadError."""
    import PyOpenColorIO as ocio

    ocio.SetLoggingLevel(ocio.LOGGING_LEVEL_NONE)
    try:
        if name.startswith(BUILT_IN):
            return ocio.Config.CreateFromFile(name)
        data = read_regular_file(Path(name), MOST_BYTES)
        if Path(name).suffix.lower() == ".ocioz":
            return ocio.Config.CreateFromFile(name)
        config = ocio.Config.CreateFromStream(data.decode("utf-8", "replace"))
        config.setWorkingDir(str(Path(name).absolute().parent))
        return config
    except (ocio.Exception, ocio.ExceptionMissingFile) as error:
        raise LoadError(name, "configuration", _first_line(error), "one of OpenColorIO") from None


def _resolved(catalogue: ConfigCatalogue, config: ocio.Config, view: ConfigView) -> ConfigView:
    displays = dict(catalogue.displays)
    display, name = view.display, view.view
    if not display and name:  # of the displays that have it the default one, else the first
        both = dict(zip((f"{d}: {v}" for d, vs in displays.items() for v in vs), _pairs(displays), strict=True))
        having = [d for d in (config.getDefaultDisplay(), *displays) if name in displays.get(d, ())]
        display, name = both.get(name, (having[0] if having else "", name))
        if not display:
            every = tuple(dict.fromkeys(v for vs in displays.values() for v in vs))
            raise LoadError(view.config, "view", name, f"one of {', '.join(every)}")
    display = display or config.getDefaultDisplay()
    if display not in displays:
        raise LoadError(view.config, "display", display, f"one of {', '.join(displays)}")
    name = name or config.getDefaultView(display)
    if name not in displays[display]:
        raise LoadError(view.config, "view", name, f"one of {', '.join(displays[display])}")
    if view.look and view.look not in catalogue.looks:
        expected = ", ".join(catalogue.looks) or "none: it has no looks"
        raise LoadError(view.config, "look", view.look, f"one of {expected}")
    return replace(view, display=display, view=name)


def _pairs(displays: dict[str, tuple[str, ...]]) -> list[tuple[str, str]]:
    return [(display, view) for display, views in displays.items() for view in views]


def _source(config: ocio.Config, name: str) -> tuple[str, str]:
    """The space of the configuration that light is given to it in, and a note on what is assumed of it."""
    if config.hasRole(INTERCHANGE):
        return INTERCHANGE, ""
    for each in _REC709_NAMES:
        space = config.getColorSpace(each)
        if space is not None:
            return str(space.getName()), ""
    if not config.hasRole(SCENE_LINEAR):
        raise LoadError(name, "roles", "none", f"the role {INTERCHANGE} or {SCENE_LINEAR}")
    return SCENE_LINEAR, f"{Path(name).name}: its scene_linear is taken as linear Rec. 709, as it has no {INTERCHANGE}"


def _processor(config: ocio.Config, view: ConfigView) -> ocio.Processor:
    """From linear Rec. 709 to the display. Raises LoadError."""
    import PyOpenColorIO as ocio

    source, _ = _source(config, view.config)
    steps = []
    if source == INTERCHANGE:
        matrix = np.eye(4)
        matrix[:3, :3] = rec709_to_aces()
        steps.append(ocio.MatrixTransform(matrix=matrix.ravel().tolist()))
    if view.look:
        steps.append(ocio.LookTransform(src=source, dst=source, looks=view.look))
    steps.append(ocio.DisplayViewTransform(src=source, display=view.display, view=view.view))
    try:
        return config.getProcessor(ocio.GroupTransform(steps))
    except (ocio.Exception, ocio.ExceptionMissingFile) as error:
        raise LoadError(view.config, f"view {view.view!r}", _first_line(error), "a view that can be made") from None


@lru_cache(maxsize=4)
def _cpu_processor(view: ConfigView) -> ocio.CPUProcessor:
    config = _load(view.config)
    return _processor(config, _resolved(catalogue_of(config, view.config), config, view)).getDefaultCPUProcessor()


def _shader(config: ocio.Config, view: ConfigView) -> ViewShader:
    import PyOpenColorIO as ocio

    processor = _processor(config, view)
    shader = ocio.GpuShaderDesc.CreateShaderDesc(
        language=ocio.GPU_LANGUAGE_GLSL_4_0, functionName=SHADER_FUNCTION, resourcePrefix="configured_"
    )
    shader.setAllowTexture1D(False)
    try:
        processor.getDefaultGPUProcessor().extractGpuShaderInfo(shader)
        flat = [
            ShaderTexture(each.samplerName, _values(each, (each.height, each.width)), _is_linear(ocio, each))
            for each in shader.getTextures()
        ]
        cubes = [
            ShaderTexture(each.samplerName, _values(each, (each.edgeLen,) * 3), _is_linear(ocio, each))
            for each in shader.get3DTextures()
        ]
    except (ocio.Exception, ocio.ExceptionMissingFile) as error:
        raise LoadError(view.config, f"view {view.view!r}", _first_line(error), "a view that can be drawn") from None
    table = tabulated(partial(_transformed, processor.getDefaultCPUProcessor()))
    return ViewShader(view, str(shader.getShaderText()), (*flat, *cubes), table)


def _values(texture, shape: tuple[int, ...]) -> NDArray[np.float32]:  # type: ignore[no-untyped-def]  # the library's
    return np.array(texture.getValues(), np.float32).reshape(*shape, -1)


def _is_linear(ocio, texture) -> bool:  # type: ignore[no-untyped-def]  # the module, imported late
    return bool(texture.interpolation != ocio.INTERP_NEAREST)


def _first_line(error: Exception) -> str:
    """What the library says, in one line."""
    return " ".join(str(error).split())[:200] or "unreadable"
