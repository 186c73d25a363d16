"""The settings that a picture is computed with, each declared once: meaning, values, and its names elsewhere.

View, plan, requests and stills hold `RenderSettings`. `SETTINGS` has what is known of each field; from it come the
validation of sessions and of the view, options of the command line, the lines of the plan, and the reference.

A *line* of a plan is what the user may override of it, by name. "lights", "patches", "bounces", "sphere", "precision",
"rays", "edges" and "nodes" apply to the whole picture; "points" and "coefficients" belong to Orbit, "transfer_rays",
"lobes" and "gloss_rows" to Deform. "teapot.1.theta_h" is the number of bands of one curve, by its layer's key and its
name. `engine.planner` determines which of them a scene has. This module imports little, because the window's process
uses it.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field, fields, replace
from typing import Any, Literal

from engine.core.errors import InsituError
from engine.scene.description import MAX_BOUNCES

LineValue = int | str
Precision = Literal["half", "float"]
# Light in place, or that of a simple preview (`engine.precompute.direct.simple_lighting`).
Lighting = Literal["scene", "no_shadows", "point_light"]

N_LIGHTS = 4000
N_PATCHES = 768
# The number of bounces, and of hemisphere rays, where a picture has as many as its scene requires.
AS_PLANNED = 0
# Limits of the storage: rows of factor A may be long, the runs of factor B are counted in bytes.
MAX_BANDS_OVERRIDDEN = (512, 128)
# Lines whose planned number a pilot may reduce.
NEEDED_LINES = frozenset({"lights", "patches"})


@dataclass(frozen=True)
class Setting:
    """What is known of one field of `RenderSettings`.

    meaning: a phrase, for the reference, the help of its option, and the plan; values: those that the user may choose,
    a range of whole numbers or a few; as_required: the value for "as the scene requires", () for a field that has none;
    option: its name on the command line, "" for none; line, label: its name in the plan, and there for the user, "" for
    none; choices: the values that a menu offers, None for all; words: values by name; mode: the one that it belongs to,
    "" for any; is_saved: whether it is part of the view, and so of a session.
    """

    meaning: str
    values: range | tuple[int | str, ...]
    as_required: tuple[int | None, ...] = ()
    option: str = ""
    line: str = ""
    label: str = ""
    choices: Sequence[int] | None = None
    words: tuple[tuple[str, int | str], ...] = ()
    mode: str = ""
    is_saved: bool = True

    @property
    def help(self) -> str:
        """The meaning as a sentence."""
        text = f"{self.mode}: {self.label.lower()} {self.meaning}" if self.mode else self.meaning
        return f"{text[0].upper()}{text[1:]}."

    @property
    def expected(self) -> str:
        """A description of the values."""
        words = {value: word for word, value in self.words}
        if isinstance(self.values, range):
            named = "".join(f" ({value}: {word})" for value, word in words.items())
            return f"a whole number from {self.values[0]} to {self.values[-1]:,}{named}"
        *first, last = (words.get(value, str(value)) for value in self.values)
        return f"{', '.join(first)} or {last}"

    @property
    def bounds(self) -> tuple[int, int]:
        """The least and the greatest of a setting whose values are numbers, that for "as required" among them."""
        numbers = [value for value in (*self.as_required, self.values[0], self.values[-1]) if isinstance(value, int)]
        return min(numbers), max(numbers)

    def nearest(self, value: Any) -> Any:
        """The possible value that is nearest to a number; any other value itself."""
        if value in self.as_required or value in self.values or not isinstance(value, int | float):
            return value
        least, most = self.bounds
        return int(min(max(value, least), most))


def _setting(default: Any, meaning: str, values: range | tuple[int | str, ...], **more: Any) -> Any:
    return field(default=default, metadata={"setting": Setting(meaning, values, **more)})


def _up_to(least: int, most: int) -> range:
    return range(least, most + 1)


@dataclass(frozen=True)
class RenderSettings:
    """The settings that a picture is computed with.

    n_lights, n_patches: the numbers that sky and emitters are cut into at the final stage, or fewer where these suffice
    (`engine.render.light_pilot`) and the user has not overridden them. n_bounces: reflections between light and camera,
    the second of at most second_bands bands a curve (1: by albedo; None: as many as it has). keeps_sphere: compute and
    store visibility in all directions, otherwise only that of the lights. precision: of transport on the graphics card.
    n_hemisphere_rays: rays per sample set of indirect light (`engine.precompute.indirect.sampling_settings`).
    n_edge_rays: rays through a pixel at an edge (`engine.scene.edges`); 0: only through its centre. n_map_nodes: layers
    that stand for one with a parameter map (`engine.material.parameter_nodes`), None for as many as are planned. Orbit
    has n_points beside the meshes' own, and stores n_coefficients of light at each; Deform traces n_rays from each of
    its points and fits n_lobes, and n_gloss_rows for each glossy layer, None for as many as a pilot finds. lighting: of
    Placement, which the view chooses; under simple light there is one bounce. overridden: the lines of the plan that
    the user has set.
    """

    n_lights: int = _setting(
        N_LIGHTS, "lights that stand for the environment", _up_to(20, 80_000), option="--lights", line="lights",
        label="Sky lights", choices=(400, 1000, 2000, 4000, 10_000, 20_000),
    )  # fmt: skip
    n_patches: int = _setting(
        N_PATCHES, "patches that emitters are cut into", _up_to(20, 80_000), option="--patches", line="patches",
        label="Lamp patches", choices=(96, 256, 768, 3000, 10_000),
    )  # fmt: skip
    n_bounces: int = _setting(
        1, "reflections between light and camera", _up_to(1, MAX_BOUNCES), as_required=(AS_PLANNED,),
        option="--bounces", line="bounces", label="Bounces",
    )  # fmt: skip
    second_bands: int | None = _setting(
        None, "bands of each curve at the second bounce", (1, 8, 16), as_required=(None,)
    )
    n_edge_rays: int | None = _setting(
        None, "rays per pixel at edges", (0, 4, 8, 16), as_required=(None,), option="--edges", line="edges",
        label="Edges", words=(("off", 0),),
    )  # fmt: skip
    n_hemisphere_rays: int = _setting(
        AS_PLANNED, "rays of each sample set of indirect light", (128, 256, 512, 1024), as_required=(AS_PLANNED,),
        line="rays", label="Hemisphere rays",
    )  # fmt: skip
    keeps_sphere: bool = _setting(
        True, "whether visibility in all directions is computed", (0, 1), line="sphere", label="Shadows from",
        is_saved=False,
    )  # fmt: skip
    precision: Precision = _setting(
        "half", "of transport on the graphics card", ("half", "float"), line="precision", label="Transport"
    )
    n_map_nodes: int | None = _setting(
        None, "nodes of each parameter that varies over a surface", _up_to(2, 6), as_required=(None,),
        option="--nodes", line="nodes", label="Map nodes", is_saved=False,
    )  # fmt: skip
    n_points: int = _setting(
        40_000, "beside the meshes' own, where light bends between these", _up_to(0, 200_000),
        line="points", label="Points", choices=(0, 2000, 10_000, 40_000, 100_000), mode="orbit",
    )  # fmt: skip
    n_coefficients: int = _setting(
        320, "of light, stored at each point; few blur highlights", _up_to(20, 1280),
        line="coefficients", label="Coefficients", choices=(40, 80, 160, 320, 640, 1280), mode="orbit",
    )  # fmt: skip
    n_rays: int = _setting(
        1000, "sent once to find unblocked directions", _up_to(32, 20_000),
        line="transfer_rays", label="Rays per point", choices=(64, 128, 256, 1000, 5000, 20_000), mode="deform",
    )  # fmt: skip
    n_lobes: int = _setting(
        4, "fitted to what the rays found; 0: light without shadows, for comparison", _up_to(0, 4), line="lobes",
        label="Lobes", mode="deform", words=(("unshadowed", 0),),
    )  # fmt: skip
    n_gloss_rows: int | None = _setting(
        None, "of transfer for each glossy layer; 0: one lobe with the shadows of a diffuse surface", _up_to(0, 16),
        as_required=(None,), line="gloss_rows", label="Gloss rows", choices=(0, 3, 6, 9, 12, 16), mode="deform",
        words=(("lobe", 0),),
    )  # fmt: skip
    lighting: Lighting = "scene"
    overridden: frozenset[str] = frozenset()

    @property
    def of_light(self) -> RenderSettings:
        """Those that the precomputed light of Placement depends on; the others have their defaults."""
        return RenderSettings(
            self.n_lights, self.n_patches, self.n_bounces, keeps_sphere=self.keeps_sphere,
            n_hemisphere_rays=self.n_hemisphere_rays, lighting=self.lighting,
            overridden=self.overridden & NEEDED_LINES,
        )  # fmt: skip

    @property
    def of_direct_light(self) -> RenderSettings:
        """Those of `of_light` that light which is reflected once depends on."""
        return replace(self.of_light, n_bounces=1, n_hemisphere_rays=AS_PLANNED)

    def with_lines(self, lines: Mapping[str, LineValue]) -> RenderSettings:
        """The settings with these lines of a plan overridden; lines of curves are not among them."""
        changes: dict[str, Any] = {FIELD_OF_LINE[line]: value for line, value in lines.items() if line in FIELD_OF_LINE}
        if "sphere" in lines:
            changes["keeps_sphere"] = bool(lines["sphere"])
        return replace(self, **changes, overridden=frozenset(lines)) if lines else self


DEFAULT_SETTINGS = RenderSettings()
SETTINGS: Mapping[str, Setting] = {
    each.name: each.metadata["setting"] for each in fields(RenderSettings) if "setting" in each.metadata
}
FIELD_OF_LINE = {setting.line: name for name, setting in SETTINGS.items() if setting.line}
PICTURE_LINES = tuple(FIELD_OF_LINE)
# Besides bounces, the lines of the modes whose light depends on neither lights nor bands.
MODE_LINES = {
    mode: tuple(setting.line for setting in SETTINGS.values() if setting.mode == mode) for mode in ("orbit", "deform")
}


def checked_setting(name: str, value: object) -> Any:
    """The value for one field, which may be that for "as required". Raises InsituError for an invalid value."""
    setting = SETTINGS[name]
    if value in setting.as_required or (not isinstance(value, bool) and value in setting.values):
        return value
    values = setting.values
    expected = setting.expected if isinstance(values, range) else f"one of {', '.join(map(str, values))}"
    raise InsituError(f"{setting.option or name} {value}: expected {expected}")


def checked_line(line: str, value: object) -> LineValue:
    """The value for one of `PICTURE_LINES`. Raises InsituError for an invalid value."""
    setting = SETTINGS[FIELD_OF_LINE[line]]
    value = dict(setting.words).get(value, value) if isinstance(value, str) else value
    if isinstance(value, bool) or not isinstance(value, int | str) or value not in setting.values:
        raise _line_error(line, value, setting.expected)
    return value


def checked_bands(line: str, value: object, n_factors: int) -> int:
    """The number of bands for one of n_factors curves of a layer. Raises InsituError."""
    most = MAX_BANDS_OVERRIDDEN[0] if n_factors == 1 else min(MAX_BANDS_OVERRIDDEN)
    if isinstance(value, bool) or not isinstance(value, int) or not 1 <= value <= most or value & (value - 1):
        raise _line_error(line, value, f"a power of two from 1 to {most}")
    return value


def bands_of_lines(key: str, planned: Mapping[str, int], lines: Mapping[str, LineValue]) -> dict[str, int]:
    """J of each curve of a layer, as planned or as overridden. Ignores a line with more bands than this model permits,
    which was set for another model of the layer."""
    counts = dict(planned)
    for name in planned:
        with suppress(InsituError):
            counts[name] = checked_bands(name, lines.get(f"{key}.{name}"), len(planned))
    return counts


def _line_error(line: str, value: object, expected: str) -> InsituError:
    return InsituError(f"plan: {line} = {value}, expected {expected}")
