"""Settings of the view, and the lines of the plan that override them."""

from dataclasses import replace

from app.document.commands.plan import OverrideLine
from app.document.document import Document
from app.document.effective_settings import effective_view, override_lines_of
from app.document.view_state import SetView, ViewState

DOCUMENT = Document("scene")
STOP = SetView.of(n_lights=400, n_patches=256, n_hemisphere_rays=0)


def test_without_lines_the_settings_of_the_view_are_set() -> None:
    assert override_lines_of(STOP, DOCUMENT) == (STOP,)


def test_what_a_line_stands_over_is_set_by_that_line() -> None:
    document = replace(DOCUMENT, overrides=(("lights", 1000), ("rays", 512)))
    assert override_lines_of(STOP, document) == (
        OverrideLine("lights", 400),
        OverrideLine("rays", None),
        SetView.of(n_patches=256),
    )
    edges = replace(DOCUMENT, overrides=(("edges", 8),))
    assert override_lines_of(SetView.of(n_edge_rays=0), edges) == (OverrideLine("edges", 0),)  # off, not as planned


def test_as_many_as_required_takes_a_line_back() -> None:
    edges = replace(DOCUMENT, overrides=(("edges", 8),))
    assert override_lines_of(SetView.of(n_edge_rays=None), edges) == (OverrideLine("edges", None),)


def test_after_it_the_picture_goes_by_what_was_set() -> None:
    document, view = replace(DOCUMENT, overrides=(("lights", 1000), ("rays", 512))), ViewState()
    assert effective_view(view, document).settings.n_hemisphere_rays == 512
    for command in override_lines_of(STOP, document):
        if isinstance(command, SetView):
            view = command.apply(view)
        else:
            document = command.apply(document)
    decided = effective_view(view, document).settings
    assert (decided.n_lights, decided.n_patches, decided.n_hemisphere_rays) == (400, 256, 0)
