"""What Deform has in the Accuracy panel: how its pictures are drawn, and what of the scene they leave out."""

from __future__ import annotations

from app.deform.status import DeformStatus
from app.view_state import SetView
from ui.panels import accuracy_orbit, accuracy_placement, widgets
from ui.panels.actions import Action
from ui.panels.context import PanelContext

LEFT_OUT = (
    "While it bends, an object has its own shadows alone, and light from afar. Shadows from one object on another, and "
    "the light of lamps, come back when the hand rests and Placement takes over."
)
SPLIT_HINT = (
    "Splits the picture: what paths through the scene show of this pose, refined while the hand rests; transfer that "
    "does not turn with the surface; and Deform's own. Drag the dividers."
)
EVENLY = (1.0 / 3.0, 2.0 / 3.0)
LEFT_OUT_AND_STAYS = (
    "Objects that bend have their own shadows alone, and light from afar. The surface of {} is Deform's alone, so that "
    "Placement does not take over when the hand rests: choose it (G) to see shadows from one object on another."
)


def draw(context: PanelContext) -> list[Action]:
    """The figures measured of what is seen, what sharp curves lose, and what comes back at rest."""
    status = context.status
    actions = accuracy_orbit.draw(context)
    if not isinstance(status, DeformStatus):
        return actions
    is_split = context.view.split is not None
    if widgets.text_button(context, "deform.split", "Not beside paths" if is_split else "Beside paths", SPLIT_HINT):
        actions.append(SetView.of(split=None if is_split else EVENLY))
    for name, share in sorted(status.lost, key=lambda each: -each[1])[:4]:
        hint = (
            "The share of this material's reflection, by energy, that is too sharp for the bands of light that follow "
            "a bending mesh. The rest is a soft highlight; Placement has all of it."
        )
        accuracy_placement.figure(context, f"Lost of {name}", f"{share:.0%}", hint)
    widgets.caption(LEFT_OUT_AND_STAYS.format(", ".join(status.alone)) if status.alone else LEFT_OUT)
    return actions
