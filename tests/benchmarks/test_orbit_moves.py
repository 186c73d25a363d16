"""The figures of objects that are dragged in Orbit, at few points."""

from benchmarks.orbit_moves import NAMES, OrbitMoveEffort, orbit_move_figures


def test_a_step_of_a_drag_takes_a_part_of_preparing_all() -> None:
    effort = OrbitMoveEffort({"cornell": "short block"}, (24, 24), 1, 500)
    figures = {figure.name: figure.samples for figure in orbit_move_figures(effort, lambda line: None)}
    assert tuple(figures) == NAMES and figures["orbit_move_ms"][0] > 0.0
    # In a box nearly all points see the block; the far sides of the other do not.
    assert figures["orbit_move_ratio"][0] > 0.0 and 0.1 < figures["orbit_move_share"][0] < 1.0


def test_a_quick_run_leaves_them_out() -> None:
    assert [figure.name for figure in orbit_move_figures(None, lambda line: None)] == list(NAMES)
