"""Views, transforms from linear radiance to display colours by name, those of OpenColorIO among them; sRGB; primaries.

ACES is built into the library. AgX is not: it is assembled here from the library's transforms and its published
parameters [Sobotka22]: an inset of the primaries; 16.5 stops in log2, of which 10 lie below middle grey; a sigmoid of
slope 2 at (10/16.5, 1/2) with power 3 in the toe and 3.25 in the shoulder; and the inverse of the inset. The result is
display-encoded. Filmic, standard and false colour are formulas (`render.display`, shaders/common/tone_mapping.glsl).

The GPU evaluates a view from a table over log2 of the three channels, 65 × 65 × 65 colours: 999 of 1,000 colours are
within 1.5 of 255 (AgX 0.4); where ACES has folds, the error reaches 9. The library is imported when a view first
requires it, not at the start of the program.

Linear RGB with other primaries and another white point is converted to Rec. 709 (`to_rec709`) as in OpenColorIO's
built-in configurations and most viewers of OpenEXR: to CIE XYZ by the chromaticities [SMPTE RP 177], from one white to
the other by Bradford's matrix [Lam85], and back by Rec. 709's. No adaptation was rejected: the grey of an ACES file,
whose white is yellower, would be tinted.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import lru_cache, partial
from pathlib import Path
from typing import TYPE_CHECKING, Literal, TypeVar

import numpy as np
from numpy.typing import NDArray

from engine.core.errors import LoadError

if TYPE_CHECKING:
    import PyOpenColorIO as ocio

Float64Array = NDArray[np.float64]
Real = TypeVar("Real", np.float32, np.float64)
ToneMapping = Literal["filmic", "agx", "aces_2", "aces_1", "linear", "false_colour"]


@dataclass(frozen=True)
class ConfigView:
    """A view of a configuration of OpenColorIO (`engine.core.colour_config`): a file, or the name of one that is built
    into the library; a display of it, one of its views, and a look; "" for the configuration's default, or no look."""

    config: str
    display: str = ""
    view: str = ""
    look: str = ""

    @property
    def label(self) -> str:
        """Its name in the window."""
        return self.view or Path(self.config).stem


AnyView = ToneMapping | ConfigView
"""A view transform: one of Insitu's own, or of a configuration."""


@dataclass(frozen=True)
class View:
    """The name of a view in the window, and its tooltip."""

    label: str
    tooltip: str


VIEWS: dict[ToneMapping, View] = {
    "filmic": View("Filmic", "Bright light rolls off gently, as on film; every hue stays what it is."),
    "agx": View("AgX", "Bright colours fade to white over 16 stops, as on film; Blender's default is of this family."),
    "aces_2": View("ACES 2.0", "The Academy's output transform for a screen of 100 nits, version 2."),
    "aces_1": View("ACES 1.3", "The Academy's output transform for video, as most studios know it."),
    "linear": View("Standard", "Plain sRGB, for comparing numbers: values above 1 are clipped."),
    "false_colour": View("False colour", "Luminance in stops, dark blue to yellow: a change of shade is one stop."),
}
TONE_MAPPINGS: tuple[ToneMapping, ...] = tuple(VIEWS)
# Views of OpenColorIO: configuration and view; AgX is assembled here.
_BUILT_IN = {
    "aces_2": ("cg-config-v4.0.0_aces-v2.0_ocio-v2.5", "ACES 2.0 - SDR 100 nits (Rec.709)"),
    "aces_1": ("cg-config-v2.2.0_aces-v1.3_ocio-v2.4", "ACES 1.0 - SDR Video"),
}
TABULATED_VIEWS = ("agx", *_BUILT_IN)
TABLE_SIDE = 65
# log2 of radiance at the table's ends; beyond them the views are black and white.
TABLE_STOPS = (-12.5, 7.5)
BRIGHTEST_SHOWN = 2.0**16

_AGX_INSET = np.array(
    [
        [0.842479062253094, 0.0784335999999992, 0.0792237451477643],
        [0.0423282422610123, 0.878468636469772, 0.0791661274605434],
        [0.0423756549057051, 0.0784336, 0.879142973793104],
    ]
)
_AGX_STOPS = (-12.47393, 4.026069)
_AGX_PIVOT, _AGX_SLOPE, _AGX_TOE, _AGX_SHOULDER = 10.0 / 16.5, 2.0, 3.0, 3.25
_AGX_SAMPLES = 4096

REC709 = (0.64, 0.33, 0.30, 0.60, 0.15, 0.06, 0.3127, 0.3290)
"""x, y of red, green, blue and white (D65) [ITU-R BT.709]."""
_ACES2065 = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
"""The same of ACES2065-1 [SMPTE ST 2065-1]."""
XYZ_PRIMARIES = (1.0, 0.0, 0.0, 1.0, 0.0, 0.0)
"""Those of CIE XYZ itself."""
_BRADFORD = np.array([[0.8951, 0.2664, -0.1614], [-0.7502, 1.7135, 0.0367], [0.0389, -0.0685, 1.0296]])
_ALIKE = 1e-4  # single precision, and the usual four digits


def find_view(name: str, file: str | Path = "view", what: str = "name") -> ToneMapping:
    """The view with this name, either its label or its name in files. Raises LoadError with the place where it was
    named."""
    wanted = name.strip().casefold()
    for view, known in VIEWS.items():
        if wanted in (view, known.label.casefold()):
            return view
    raise LoadError(file, what, name, ", ".join(known.label for known in VIEWS.values()))


def encode_srgb(linear: NDArray[np.floating]) -> NDArray[np.float64]:
    """sRGB-encodes linear values in [0, 1] (IEC 61966-2-1; shaders/common/srgb.glsl does the same)."""
    linear = np.asarray(linear, np.float64)
    power = 1.055 * np.maximum(linear, 0.0031308) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, power)


def decode_srgb(encoded: NDArray[Real]) -> NDArray[Real]:
    """Decodes sRGB values in [0, 1] to linear ones, in the same precision; above 1 the curve continues."""
    x = np.maximum(encoded, 0.0)
    return np.where(x <= 0.04045, x / 12.92, ((x + 0.055) / 1.055) ** 2.4)


def display_transform(radiance: NDArray[np.floating], view: ToneMapping) -> NDArray[np.float32]:
    """Linear Rec. 709 radiance (..., 3) as sRGB-encoded values in [0, 1], by one of the views in `TABULATED_VIEWS`."""
    values = np.clip(np.nan_to_num(radiance, nan=0.0), 0.0, BRIGHTEST_SHOWN)
    pixels = np.array(values, np.float32, order="C").reshape(-1, 3)
    if len(pixels):
        _processor(view).applyRGB(pixels)
    return np.clip(pixels, 0.0, 1.0).reshape(radiance.shape)


@lru_cache(maxsize=len(TABULATED_VIEWS))
def view_table(view: ToneMapping) -> NDArray[np.float16]:
    """The view as a table."""
    return tabulated(partial(display_transform, view=view))


def tabulated(transform: Callable[[NDArray[np.floating]], NDArray[np.floating]]) -> NDArray[np.float16]:
    """A transform of light to display colours over log2 of radiance within `TABLE_STOPS`: (blue, green, red, 3),
    `TABLE_SIDE` colours along each axis."""
    levels = np.exp2(np.linspace(*TABLE_STOPS, TABLE_SIDE))
    blue, green, red = np.meshgrid(levels, levels, levels, indexing="ij")
    return transform(np.stack([red, green, blue], axis=-1)).astype(np.float16)


def agx_sigmoid(x: NDArray[np.floating]) -> NDArray[np.float64]:
    """The sigmoid of AgX from log2 radiance to display, both in [0, 1]: y = 1/2 + s d (1 + a |d|^p)^(-1/p), d = x -
    pivot.

    The power p is that of toe or shoulder; a is such that the curve ends in (0, 0) or (1, 1) [Sobotka22].
    """
    d = np.asarray(x, np.float64) - _AGX_PIVOT
    power = np.where(d < 0.0, _AGX_TOE, _AGX_SHOULDER)
    reach = np.where(d < 0.0, _AGX_PIVOT, 1.0 - _AGX_PIVOT)
    a = ((2.0 * _AGX_SLOPE * reach) ** power - 1.0) / reach**power
    return 0.5 + _AGX_SLOPE * d * (1.0 + a * np.abs(d) ** power) ** (-1.0 / power)


@lru_cache(maxsize=len(TABULATED_VIEWS))
def _processor(view: ToneMapping) -> ocio.CPUProcessor:
    """The library's processor for a view, cached."""
    import PyOpenColorIO as ocio

    if view == "agx":
        return ocio.Config.CreateRaw().getProcessor(_agx(ocio)).getDefaultCPUProcessor()
    config_name, view_name = _BUILT_IN[view]
    config = ocio.Config.CreateFromBuiltinConfig(config_name)
    transform = ocio.DisplayViewTransform(src="Linear Rec.709 (sRGB)", display="sRGB - Display", view=view_name)
    return config.getProcessor(transform).getDefaultCPUProcessor()


def _agx(ocio):  # type: ignore[no-untyped-def]  # the module, imported late
    """AgX as a chain of the library's transforms."""
    low, high = _AGX_STOPS
    curve = ocio.Lut1DTransform(length=_AGX_SAMPLES, inputHalfDomain=False)
    for i, value in enumerate(agx_sigmoid(np.linspace(0.0, 1.0, _AGX_SAMPLES))):
        curve.setValue(i, value, value, value)
    return ocio.GroupTransform(
        [
            _matrix(ocio, _AGX_INSET),
            ocio.RangeTransform(2.0**low, 2.0**high, 2.0**low, 2.0**high),
            ocio.LogTransform(base=2.0),
            ocio.RangeTransform(low, high, 0.0, 1.0),
            curve,
            _matrix(ocio, np.linalg.inv(_AGX_INSET)),
            ocio.RangeTransform(0.0, 1.0, 0.0, 1.0),
        ]
    )


def _matrix(ocio, rows):  # type: ignore[no-untyped-def]
    padded = np.eye(4)
    padded[:3, :3] = rows
    return ocio.MatrixTransform(matrix=padded.ravel().tolist())


def to_rec709(chromaticities: Sequence[float]) -> Float64Array | None:
    """The matrix (3, 3) from linear RGB with these primaries, x and y of red, green, blue and white; None for those of
    Rec. 709. Raises ValueError for invalid primaries."""
    if np.abs(np.subtract(chromaticities, REC709)).max() <= _ALIKE:
        return None
    white = _xyz(chromaticities[6:])
    matrix = np.linalg.inv(_to_xyz(REC709)) @ adaptation(white, _xyz(REC709[6:])) @ _to_xyz(chromaticities)
    if not np.isfinite(matrix).all() or np.abs(matrix).max() > 100.0:
        raise ValueError("chromaticities of no colours")
    return matrix


def rec709_to_aces() -> Float64Array:
    """The matrix (3, 3) from linear Rec. 709 to ACES2065-1."""
    to_rec = to_rec709(_ACES2065)
    assert to_rec is not None
    return np.asarray(np.linalg.inv(to_rec))


def view_label(view: AnyView) -> str:
    """The name of a view in the window."""
    return view.label if isinstance(view, ConfigView) else VIEWS[view].label


def xyz_to_rec709() -> Float64Array:
    """The matrix (3, 3) from CIE XYZ with Rec. 709's white."""
    return np.asarray(np.linalg.inv(_to_xyz(REC709)))


def luminance_weights(chromaticities: Sequence[float]) -> Float64Array:
    """The weights (3,) of red, green and blue in luminance, with sum 1. Raises ValueError for invalid primaries."""
    weights = _to_xyz(chromaticities)[1]
    if not np.isfinite(weights).all() or not 1e-3 < weights[1] < 1e3:
        raise ValueError("chromaticities of no colours")
    return np.asarray(weights / weights.sum())


def adaptation(white: Float64Array, to: Float64Array) -> Float64Array:
    """The matrix (3, 3) that adapts colours in XYZ from one white to another [Lam85]."""
    return np.linalg.inv(_BRADFORD) @ np.diag((_BRADFORD @ to) / (_BRADFORD @ white)) @ _BRADFORD


def _to_xyz(chromaticities: Sequence[float]) -> Float64Array:
    """The matrix (3, 3) from linear RGB to XYZ, white at Y = 1 [SMPTE RP 177]. A primary may have no luminance."""
    x, y = np.reshape(chromaticities[:6], (3, 2)).T
    primaries = np.stack([x, y, 1.0 - x - y])
    try:
        return primaries * np.linalg.solve(primaries, _xyz(chromaticities[6:]))
    except np.linalg.LinAlgError:
        raise ValueError("chromaticities on a line") from None


def _xyz(chromaticity: Sequence[float]) -> Float64Array:
    """XYZ with Y = 1 of a chromaticity x, y."""
    x, y = chromaticity
    if not y > 1e-6 and not y < -1e-6:
        raise ValueError("a chromaticity without luminance")
    return np.array([x / y, 1.0, (1.0 - x - y) / y])
