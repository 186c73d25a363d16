"""The knobs of all modes on one scene, into a folder."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import chain
from pathlib import Path

from app.measure import knobs_deform, knobs_orbit, knobs_placement
from app.measure.knob_report import write_report
from app.measure.knobs import measured, write_knobs
from app.measure.knobs_deform import DeformKnobs, deform_knobs
from app.measure.knobs_orbit import OrbitKnobs, orbit_knobs
from app.measure.knobs_placement import PlacementKnobs, placement_knobs
from app.measure.machine import load_average, machine_facts
from app.measure.subject import at_most, open_subject
from app.project.project import open_project


@dataclass(frozen=True)
class KnobEffort:
    """Which settings of each mode's knobs are computed, and how often."""

    placement: PlacementKnobs = field(default_factory=PlacementKnobs)
    orbit: OrbitKnobs = field(default_factory=OrbitKnobs)
    deform: DeformKnobs = field(default_factory=DeformKnobs)
    repetitions: int = 3


QUICKLY = KnobEffort(knobs_placement.QUICKLY, knobs_orbit.QUICKLY, knobs_deform.QUICKLY, 1)


def measure_knobs(source: str, output: Path, effort: KnobEffort, report: Callable[[str], None]) -> None:
    """knobs.csv, front.json, report.md and its plots. Raises InsituError when the scene cannot be opened."""
    facts, subject = machine_facts(), open_subject(source)
    resolution = at_most(subject.scene.resolution, effort.placement.side)
    subject = replace(subject, scene=replace(subject.scene, resolution=resolution))
    knobs = chain(
        placement_knobs(subject, effort.placement),
        orbit_knobs(subject, open_project(source, resolution), effort.orbit),
        deform_knobs(effort.deform),
    )
    rows = measured(knobs, effort.repetitions, report)
    context = {
        "scene": subject.scene.description.name,
        "resolution": list(resolution),
        "repetitions": effort.repetitions,
        "machine": facts,
        "load_average_after": load_average(),
    }
    write_knobs(output, rows, context)
    write_report(output, rows, context)
