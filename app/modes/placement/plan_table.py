"""The plan of the picture on screen as lines to read: each line's value, the reason, and the other choices.

It is put together whenever it is shown, from what is known anyway: the document's overrides, the settings of the view,
and what the worker has planned.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from app.document.document import Document, reflecting_layers
from app.document.effective_settings import KNOBS
from app.document.view_state import ViewState
from app.messages.editor_status import Status, duration
from app.modes.placement.placement_status import PlacementStatus
from engine.material.layer import Layer, object_of
from engine.plan_lines import HEMISPHERE_RAYS, MAX_BANDS_OVERRIDDEN, MODE_LINES, LineValue
from engine.planner import PRECISION_REASON, RAYS_REASON, edge_reason, sphere_reason, usual_bands
from engine.scene.description import MAX_BOUNCES

Choices = tuple[tuple[str, LineValue], ...]

LIGHT_CHOICES = (400, 1000, 2000, 4000, 10_000, 20_000)
PATCH_CHOICES = (96, 256, 768, 3000, 10_000)
BAND_CHOICES = tuple(2**n for n in range(10))
SPHERE = {1: "every direction", 0: "the lights' alone"}
EDGES = {0: "off", 4: "4 rays", 8: "8 rays", 16: "16 rays"}
OF_MODES = {
    "points": ("Points", "beside the meshes' own, where light bends between these", (0, 2000, 10_000, 40_000, 100_000)),
    "coefficients": (
        "Coefficients",
        "of light, stored at each point; few blur highlights",
        (40, 80, 160, 320, 640, 1280),
    ),
    "transfer_rays": (
        "Rays per point",
        "sent once, to find unblocked directions",
        (64, 128, 256, 1000, 5000, 20_000),
    ),
    "lobes": ("Lobes", "fitted to what the rays found", (1, 2, 3, 4)),
}
KNOB = "set in the scene or the Accuracy panel"
HALVES = {"half": "half floats", "float": "full floats"}


@dataclass(frozen=True)
class PlanTableRow:
    """One line: its name in the plan, its title for users, its value and reason, and its choices.

    group: the key of the layer that it belongs to, "" for the whole picture; is_set: the user has set it. A line
    without choices sums up the others.
    """

    line: str
    title: str
    value: str
    reason: str
    choices: Choices
    is_set: bool
    group: str = ""


def plan_table(document: Document, view: ViewState, status: Status) -> tuple[PlanTableRow, ...]:
    """The lines of the current mode: of the picture, then of each layer that reflects."""
    lines = [*_common_lines(document, view, status), *_mode_lines(document, view)]
    if isinstance(status, PlacementStatus):
        lines = [_cost_line(status), *_light_lines(document, view, status), *lines, *_curve_lines(document, status)]
    return tuple(lines)


def _line(
    document: Document, line: str, title: str, planned: LineValue | str, reason: str, choices: Choices, group: str = ""
) -> PlanTableRow:
    """planned: the value, or words, where the user has not set it."""
    lines, words = dict(document.overrides), {value: text for text, value in choices}
    as_planned = words.get(planned) or (f"{planned:,}" if isinstance(planned, int) else planned)
    if line not in lines:
        return PlanTableRow(line, title, as_planned, reason, choices, False, group)
    value = lines[line]
    set_to = words.get(value) or f"{value:,}"
    return PlanTableRow(line, title, set_to, f"set by the user; planned: {as_planned}", choices, True, group)


def _cost_line(status: PlacementStatus) -> PlanTableRow:
    """The cost of the picture: the time left while it is being computed, then the time it took."""
    memory = f"{status.memory_mb:.0f} MB of main memory, {status.gpu_mb:.0f} MB on the graphics card"
    if status.spent_seconds is None:
        left = "being computed" if status.seconds_left is None else f"{duration(status.seconds_left)} to go"
        return PlanTableRow("cost", "Cost", left, f"so far {memory}", (), False)
    reason = f"of processor time since the last change; {memory}"
    return PlanTableRow("cost", "Cost", duration(status.spent_seconds), reason, (), False)


def _light_lines(document: Document, view: ViewState, status: PlacementStatus) -> Iterator[PlanTableRow]:
    why = status.plan_reasons
    if status.has_sky:
        reason = why.get("lights", "triangles cut from the sky where it is bright")
        n_lights = status.needed_lights or view.n_lights
        yield _line(document, "lights", "Sky lights", n_lights, reason, _numbers(LIGHT_CHOICES))
        yield _line(document, "sphere", "Shadows from", 1, sphere_reason(True, True), _named(SPHERE))
    if any(state.emission is not None and any(state.emission) for state in document.objects):
        reason = why.get("patches", "parts of the emitters in the scene")
        n_patches = status.needed_patches or view.n_patches
        yield _line(document, "patches", "Lamp patches", n_patches, reason, _numbers(PATCH_CHOICES))
    if dict(document.overrides).get("bounces", view.n_bounces) != 1:
        n_rays = view.n_hemisphere_rays or status.found_rays or "as needed"
        reason = KNOB if view.n_hemisphere_rays else why.get("rays") or RAYS_REASON
        yield _line(document, "rays", "Hemisphere rays", n_rays, reason, _numbers(HEMISPHERE_RAYS))
    yield _line(document, "precision", "Transport", view.precision, PRECISION_REASON, _named(HALVES))


def _common_lines(document: Document, view: ViewState, status: Status) -> Iterator[PlanTableRow]:
    why = status.plan_reasons.get("bounces") if isinstance(status, PlacementStatus) else ""
    planned = view.n_bounces or "automatic"
    yield _line(document, "bounces", "Bounces", planned, why or KNOB, _numbers(range(1, MAX_BOUNCES + 1)))
    n_rays = status.planned_edges if view.n_edge_rays is None else view.n_edge_rays
    reason = edge_reason(n_rays) if view.n_edge_rays is None else KNOB
    yield _line(document, "edges", "Edges", n_rays, reason, _named(EDGES))


def _mode_lines(document: Document, view: ViewState) -> Iterator[PlanTableRow]:
    """The lines of Orbit's or Deform's own light."""
    for line in MODE_LINES.get(view.mode, ()):
        title, reason, choices = OF_MODES[line]
        yield _line(document, line, title, getattr(view, KNOBS[line]), reason, _numbers(choices))


def _curve_lines(document: Document, status: PlacementStatus) -> Iterator[PlanTableRow]:
    planned = dict(status.planned_bands)
    for key, layer in reflecting_layers(document):
        counts = planned.get(key, {})
        most = MAX_BANDS_OVERRIDDEN[0] if len(counts) == 1 else min(MAX_BANDS_OVERRIDDEN)
        choices = tuple((f"{n} bands", n) for n in BAND_CHOICES if n <= most)
        for name, n_bands in counts.items():
            title, reason = layer.model.factor(name).label, _why_so_many(document, key, layer, name, counts)
            yield _line(document, f"{key}.{name}", title, n_bands, reason, choices, key)


def _why_so_many(document: Document, key: str, layer: Layer, name: str, counts: Mapping[str, int]) -> str:
    kept = "" if document.object(object_of(key)).editable else "; a fixed object stores none"
    if document.first_bands is not None:
        return "as set in the Accuracy panel" + kept
    if counts[name] > usual_bands(layer.model)[name]:
        return "the curve's own bandwidth" + kept
    return ("room for edits" if not kept else "as finely as if it were editable") + kept


def _numbers(values: range | tuple[int, ...]) -> Choices:
    return tuple((f"{n:,}", n) for n in values)


def _named(names: Mapping[int, str] | Mapping[str, str]) -> Choices:
    return tuple((name, value) for value, name in names.items())
