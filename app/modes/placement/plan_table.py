"""The plan of the picture on screen as lines to read: each line's value, the reason, and the other choices.

It is put together whenever it is shown, from what is known anyway: the document's overrides, the settings of the view,
and what the worker has planned.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass

from app.document.display_names import with_display_names
from app.document.document import Document, reflecting_layers
from app.document.light_mix import emission_of
from app.document.looks import shown_looks
from app.document.node_layers import nodes_reason
from app.document.view_state import ViewState
from app.messages.editor_status import Status, duration
from app.modes.deform.deform_status import DeformStatus
from app.modes.placement.placement_status import PlacementStatus
from engine.material.layer import Layer, object_of
from engine.planner import PRECISION_REASON, RAYS_REASON, edge_reason, sphere_reason, usual_bands
from engine.settings import FIELD_OF_LINE, MAX_BANDS_OVERRIDDEN, MODE_LINES, SETTINGS, LineValue

Choices = tuple[tuple[str, LineValue], ...]

BAND_CHOICES = tuple(2**n for n in range(10))
SPHERE: Mapping[LineValue, str] = {1: "every direction", 0: "the lights' alone"}
EDGES: Mapping[LineValue, str] = {0: "off", 4: "4 rays", 8: "8 rays", 16: "16 rays"}
BY_PILOT = "by a pilot"
BY_USER = "set in the scene or the Accuracy panel"
PRECISIONS: Mapping[LineValue, str] = {"half": "half floats", "float": "full floats"}


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
    lines += _looks_line(document, view, status)
    if isinstance(status, DeformStatus):
        lines += _gloss_lines(document, status)
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
    on_card = status.gpu_mb + status.looks_gpu_mb
    memory = f"{status.memory_mb:.0f} MB of main memory, {on_card:.0f} MB on the graphics card"
    if status.spent_seconds is None:
        left = "being computed" if status.seconds_left is None else f"{duration(status.seconds_left)} to go"
        return PlanTableRow("cost", "Cost", left, f"so far {memory}", (), False)
    reason = f"of processor time since the last change; {memory}"
    return PlanTableRow("cost", "Cost", duration(status.spent_seconds), reason, (), False)


def _setting_line(
    document: Document, line: str, planned: LineValue | str, reason: str, names: Mapping[LineValue, str] | None = None
) -> PlanTableRow:
    """The line of a render setting; names: of its choices."""
    setting = SETTINGS[FIELD_OF_LINE[line]]
    values = names or (setting.values if setting.choices is None else setting.choices)
    words = {value: word for word, value in setting.words} if names is None else names
    choices = tuple((words.get(value) or f"{value:,}", value) for value in values)
    return _line(document, line, setting.label, planned, reason, choices)


def _light_lines(document: Document, view: ViewState, status: PlacementStatus) -> Iterator[PlanTableRow]:
    why, settings = status.plan_reasons, view.settings
    if status.has_sky:
        reason = why.get("lights", "triangles cut from the sky where it is bright")
        yield _setting_line(document, "lights", status.needed_lights or settings.n_lights, reason)
        yield _setting_line(document, "sphere", 1, sphere_reason(True, True), SPHERE)
    if any(any(emission) for _, emission in emission_of(document)):
        reason = why.get("patches", "parts of the emitters in the scene")
        yield _setting_line(document, "patches", status.needed_patches or settings.n_patches, reason)
    if status.mixed_lights > 1:
        reason = "pictures of each light alone, whose weighted sum shows a mix at once"
        yield PlanTableRow("mix", "Mixed lights", f"{status.mixed_lights:,}", reason, (), False)
    if dict(document.overrides).get("bounces", settings.n_bounces) != 1:
        n_rays = settings.n_hemisphere_rays or status.found_rays or "as needed"
        reason = BY_USER if settings.n_hemisphere_rays else why.get("rays") or RAYS_REASON
        yield _setting_line(document, "rays", n_rays, reason)
        if status.sampling_reason:
            sets = f"{status.sample_sets:.1f} sets a point"
            yield PlanTableRow("sampling", "Rays after edits", sets, status.sampling_reason, (), False)
        if why.get("gloss"):
            knots = f"{status.gloss_knots} knots" if status.gloss_knots else "none"
            yield PlanTableRow("gloss", "Gloss followed", knots, why["gloss"], (), False)
    yield _setting_line(document, "precision", settings.precision, PRECISION_REASON, PRECISIONS)


def _common_lines(document: Document, view: ViewState, status: Status) -> Iterator[PlanTableRow]:
    why = status.plan_reasons.get("bounces") if isinstance(status, PlacementStatus) else ""
    yield _setting_line(document, "bounces", view.settings.n_bounces or "automatic", why or BY_USER)
    chosen = view.settings.n_edge_rays
    n_rays = status.planned_edges if chosen is None else chosen
    yield _setting_line(document, "edges", n_rays, edge_reason(n_rays) if chosen is None else BY_USER, EDGES)
    if counts := status.map_nodes:
        numbers = ", ".join(f"{each.n_nodes}" for each in counts)
        yield _setting_line(document, "nodes", numbers, with_display_names(document, nodes_reason(counts)))


def _looks_line(document: Document, view: ViewState, status: Status) -> Iterator[PlanTableRow]:
    """What looks side by side take, besides what is edited: measured."""
    shown = shown_looks(document, view.looks_shown)
    if view.looks_shown > 1 and len(shown) > 1:
        memory = f"{status.looks_mb:.0f} MB of main memory, {status.looks_gpu_mb:.0f} MB on the graphics card"
        reason = f"{memory}, with the process that draws them, which has the scene once more"
        yield PlanTableRow("looks", "Side by side", f"{len(shown)} looks", reason, (), False)


def _mode_lines(document: Document, view: ViewState) -> Iterator[PlanTableRow]:
    """The lines of Orbit's or Deform's own light."""
    for line in MODE_LINES.get(view.mode, ()):
        name = FIELD_OF_LINE[line]
        planned = getattr(view.settings, name)
        yield _setting_line(document, line, BY_PILOT if planned is None else planned, SETTINGS[name].meaning)


def _gloss_lines(document: Document, status: DeformStatus) -> Iterator[PlanTableRow]:
    """How Deform draws each glossy layer, as it has been decided."""
    shown = {key for key, _ in reflecting_layers(document)}
    for plan in status.gloss:
        if plan.key in shown:
            value = f"{plan.value}, {plan.n_bytes / 1e6:.0f} MB" if plan.n_bytes else plan.value
            yield PlanTableRow("gloss", "Gloss", value, plan.reason, (), False, plan.key)


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
