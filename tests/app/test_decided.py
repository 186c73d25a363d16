"""Knobs of the view, and the lines of the plan that stand over them."""

from dataclasses import replace

from app.commands.plan import Overrule
from app.decided import by_lines, decided_view, decisions_of
from app.document import Document
from app.view_state import SetView, ViewState

DOCUMENT = Document("scene")
STOP = SetView.of(n_lights=400, n_patches=256, n_fan_rays=0)


def test_without_lines_the_knobs_are_set() -> None:
    assert by_lines(STOP, DOCUMENT) == (STOP,)


def test_what_a_line_stands_over_is_set_by_that_line() -> None:
    document = replace(DOCUMENT, overrules=(("lights", 1000), ("rays", 512)))
    assert by_lines(STOP, document) == (Overrule("lights", 400), Overrule("rays", None), SetView.of(n_patches=256))
    edges = replace(DOCUMENT, overrules=(("edges", 8),))
    assert by_lines(SetView.of(n_edge_rays=0), edges) == (Overrule("edges", 0),)  # off, not as planned


def test_after_it_the_picture_goes_by_what_was_set() -> None:
    document, view = replace(DOCUMENT, overrules=(("lights", 1000), ("rays", 512))), ViewState()
    assert decisions_of(decided_view(view, document), document).n_rays == 512
    for command in by_lines(STOP, document):
        if isinstance(command, SetView):
            view = command.apply(view)
        else:
            document = command.apply(document)
    decided = decisions_of(decided_view(view, document), document)
    assert (decided.n_lights, decided.n_patches, decided.n_rays) == (400, 256, 0)
