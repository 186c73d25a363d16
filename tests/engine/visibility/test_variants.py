"""The thesis' visibility methods against brute force: as right, and as wrong, as it found them [BenArtzi07, 8.7]."""

import numpy as np
import pytest

from engine.scene.builtin import builtin_scenes
from engine.scene.hits import PrimaryHits
from engine.scene.load import load_scene
from engine.scene.raycaster import RayCaster
from engine.sphere.geodesic import geodesic
from engine.transport.lighting import prepare_lighting
from engine.transport.pipeline import Placement
from engine.visibility.points import brute_force_visibility
from engine.visibility.targets import Targets
from tests.naive.sphere import vertex_neighbours
from tests.naive.visibility_variants import VARIANTS, trace_variant

# Most answers that may be wrong, of those above the horizon. The thesis gives 0.1 % for the five that it trusts and
# shows the shadows that scanline with uncertainty loses.
MOST_WRONG = {"SNU": 0.03, "SWU": 0.02, "SNB": 1e-3, "SWB": 1e-3, "GNB": 2e-3, "GNU": 1e-3, "GWB": 1e-3, "GWU": 1e-3,
              "OPT": 1e-3, "TRUE": 0.0}  # fmt: skip

Shapes = tuple[PrimaryHits, RayCaster, Targets]


@pytest.fixture(scope="module")
def shapes() -> Shapes:
    placement = Placement(load_scene(builtin_scenes()["shapes"], (40, 40)))
    sphere = geodesic(2)
    centres = np.ascontiguousarray(sphere.centres, np.float32)
    targets = Targets(centres, np.zeros_like(centres), vertex_neighbours(sphere.triangles))
    return placement.hits, placement.caster, targets


@pytest.fixture(scope="module")
def results(shapes: Shapes) -> dict[str, tuple[float, float]]:
    """Share of wrong answers and of rays traced, by variant."""
    rows = np.arange(len(shapes[0].pixel))
    true = brute_force_visibility(*shapes, rows)
    found = {}
    for variant in VARIANTS:
        bits, n_rays = trace_variant(*shapes, variant)
        found[variant] = ((bits != true.unpacked(rows)).sum() / true.rays.possible, n_rays / true.rays.possible)
    return found


@pytest.mark.sweep
@pytest.mark.parametrize("variant", VARIANTS)
def test_wrong_answers_are_of_the_published_order(results, variant: str) -> None:
    wrong, traced = results[variant]
    assert wrong <= MOST_WRONG[variant]
    assert traced == 1.0 if variant == "TRUE" else traced < 0.8


@pytest.mark.sweep
def test_the_thesis_ranking_holds(results) -> None:
    wrong, traced = ({variant: pair[i] for variant, pair in results.items()} for i in (0, 1))
    # Scanline with uncertainty is what loses shadows, by far.
    assert min(wrong["SNU"], wrong["SWU"]) > 3 * max(wrong[v] for v in ("SWB", "GNU", "GWB", "GWU", "OPT"))
    # OPT asks less than all that can be trusted; uncertainty asks less than boundaries.
    assert traced["OPT"] < min(traced[v] for v in ("SWB", "GNB", "GNU", "GWB", "GWU"))
    assert traced["GNU"] < traced["GNB"] and traced["GWU"] < traced["GWB"]


def test_another_name_and_other_targets_are_refused(shapes: Shapes) -> None:
    hits, caster, directions = shapes
    with pytest.raises(ValueError, match="expected one of SNB"):
        trace_variant(hits, caster, directions, "XYZ")  # type: ignore[arg-type]
    with pytest.raises(ValueError, match="of points"):
        trace_variant(hits, caster, prepare_lighting(None, None, 1.0).emitter_targets, "OPT")
