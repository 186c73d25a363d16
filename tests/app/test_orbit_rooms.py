"""Orbit at rest in rooms that nobody tuned, against paths, Placement and the same room built otherwise."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from app.document.pareto_front import load_front
from app.project.project import open_project, with_overrides
from app.stills.stills import render_project
from engine.precompute.direct.pipeline import Placement
from engine.precompute.indirect.sampling_settings import BounceSeries
from tests.app.test_orbit_stills import inner, off
from tests.rooms import ROOMS, inside_out, slit, solid

FEW = {"n_points": 2500}


def still(room: Path, size: tuple[int, int], n_bounces: int, **how: Any) -> np.ndarray:
    picture = render_project(
        open_project(str(room), size), lambda _: None, series=BounceSeries(n_bounces), **how
    ).picture
    assert np.isfinite(picture).all()
    return picture


WAYS: list[tuple[str, dict[str, Any], float]] = [
    ("orbit", {"mode": "orbit", **FEW}, 0.03),
    ("placement", {}, 0.03),
    ("paths", {"reference": True, "n_samples": 32}, 0.12),
]


@pytest.mark.parametrize(("mode", "how", "most"), WAYS)
@pytest.mark.parametrize("scene", [inside_out, solid])
def test_which_way_a_shell_is_wound_is_nothing_to_see(
    scene: Callable[..., Path], mode: str, how: dict[str, Any], most: float, tmp_path: Path
) -> None:
    # Shading is two-sided: a room that is built as a solid box looks as one whose walls face inwards, and a block whose
    # faces all face inwards as one that faces outwards.
    more = {"has_ball": False} if scene is inside_out else {}
    inward, outward = (
        still(scene(tmp_path / name, inward=name == "in", **more), (24, 18), 2, n_patches=64, **how)
        for name in ("in", "out")
    )
    right, wound = (inward, outward) if scene is inside_out else (outward, inward)
    error, difference = off(wound, right)
    assert right.mean() > 0.1
    assert error < most and abs(difference) < most / 4


def test_no_light_comes_through_a_wall(tmp_path: Path) -> None:
    # Two rooms with 12 cm of wall between them, the lamp in the other one: what the camera sees is dark.
    dark = still(slit(tmp_path / "shut", width=0.0), (32, 24), 3, n_patches=16, mode="orbit", **FEW)
    ajar = still(slit(tmp_path / "open", width=0.3), (32, 24), 3, n_patches=16, mode="orbit", **FEW)
    assert dark.max() < 1e-3 * ajar.mean()


# relRMSE and difference of means of pixels whose neighbours show the same object, in 64 × 48 with everything else as
# `insitu render` has it: what was measured, and a little more. docs/orbit.md says where more than a tenth comes from.
MEASURED = {
    "ajar": (0.11, 0.02), "room": (0.07, 0.02), "stairwell": (0.05, 0.02), "storeroom": (0.1, 0.02),
    "inside_out": (0.03, 0.01), "slats": (0.105, 0.02), "slit": (1.4, 0.03),
}  # fmt: skip


@pytest.mark.sweep
@pytest.mark.parametrize("name", MEASURED)
def test_rooms_at_rest_are_as_bright_as_in_placement(name: str, tmp_path: Path) -> None:
    room = str(ROOMS[name](tmp_path)) if name in ROOMS else name
    finest = dict(load_front().nearest_point("placement", 1.0).settings)
    project = open_project(room, (64, 48))
    fine = with_overrides(project, {"rays": finest.pop("n_hemisphere_rays")})
    truth = render_project(fine, lambda _: None, series=BounceSeries(4), **finest).picture
    found = render_project(project, lambda _: None, series=BounceSeries(4), mode="orbit").picture
    where = inner(Placement(project.scene))
    error, difference = off(found[where], truth[where])
    assert error < MEASURED[name][0] and abs(difference) < MEASURED[name][1]
