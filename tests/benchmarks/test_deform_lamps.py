"""The figures of a lamp that is dragged in Deform, at few points."""

from benchmarks.deform_lamps import NAMES, DeformLampEffort, deform_lamp_figures
from benchmarks.figures import SPECS


def test_a_step_of_a_drag_takes_a_part_of_tracing_its_light() -> None:
    effort = DeformLampEffort({"cornell": "light"}, ("teatray",), (48, 48), 2, 64, 800)
    figures = {figure.name: figure.samples for figure in deform_lamp_figures(effort, lambda line: None)}
    assert tuple(figures) == NAMES and set(NAMES) <= SPECS.keys()
    assert figures["deform_lamp_ms"][0] > 0.0 and 0.0 < figures["deform_lamp_ratio"][0] < 1.0
    assert 0.0 < figures["deform_lamp_error"][0] < 0.5
    assert len(figures["deform_painted_ms"]) == 1 and figures["deform_painted_ms"][0] > 0.0


def test_a_quick_run_leaves_them_out() -> None:
    assert [figure.name for figure in deform_lamp_figures(None, lambda line: None)] == list(NAMES)
