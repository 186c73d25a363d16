"""What a scene requires: bands by the curve, lights, shadows, overruled lines, and a pilot's estimate."""

from collections.abc import Iterator
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from engine.core.errors import InsituError
from engine.material import MODELS, make_layer
from engine.material.kinds import THETA_H
from engine.material.layer import Layer
from engine.measured.measurement import Measurement, node_angles
from engine.planner import (
    BANDWIDTH_TOLERANCE,
    EDITABLE_BANDS,
    MOST_BANDS,
    Plan,
    band_counts,
    bandwidth,
    curve_deviation,
    plan_lines,
    plan_scene,
)
from engine.scene.scene_loader import Scene, load_scene
from engine.settings import AS_PLANNED, RenderSettings
from tests.scene_text import camera, material, placed, scaled

SCENE = (
    camera((0, 1, 4), resolution=(24, 20))
    + placed("ball", "sphere", more=material('model = "lambert"', 'model = "rough_conductor", alpha = 0.4'))
    + placed("lamp", "quad", scaled(1, (0, 3, 0)), "emission = EMISSION\n")
)


def conductor(alpha: float) -> Layer:
    return make_layer(MODELS["rough_conductor"], {"alpha": alpha})


@pytest.fixture(params=["0.0", "5.0"], ids=["dark lamp", "lamp"])
def scene(tmp_path: Path, request: pytest.FixtureRequest) -> Scene:
    (tmp_path / "scene.toml").write_text(SCENE.replace("EMISSION", request.param))
    return load_scene(tmp_path / "scene.toml")


@pytest.fixture
def layers() -> dict[str, Layer]:
    return {"ball.0": make_layer(MODELS["lambert"]), "ball.1": conductor(0.4)}


def measured_lobe(degrees: float) -> Layer:
    """A measured highlight, half as high at so many degrees; nothing else of it was read."""
    theta_h = node_angles(True)[:, None]
    fall = np.exp(-np.log(2.0) * (np.tan(theta_h) / np.tan(np.radians(degrees))) ** 2 * np.ones(3))
    even = np.ones_like(fall)
    curves = tuple(np.asarray(c, np.float32).tobytes() for c in (even, even, even, np.maximum(fall, 1e-6), even, even))
    return make_layer(MODELS["measured"], {"file": Measurement("drawn.binary", 7, curves=curves)})


def test_a_narrow_measured_highlight_gets_the_bands_it_needs() -> None:
    # What analytic lobes make do with is too few for a measured one of the same width, as it is held against its data.
    assert band_counts(measured_lobe(5.0)) == {"theta_h": 64, "theta_d": 16}
    assert band_counts(measured_lobe(1.3)) == {"theta_h": 128, "theta_d": 16}
    assert band_counts(conductor(0.035))["theta_h"] == 64


def test_a_constant_curve_needs_one_band() -> None:
    # Lambert's curve is the albedo, the same at every angle: one mean holds all of it.
    layer = make_layer(MODELS["lambert"], {"albedo": (0.8, 0.0, 0.1)})
    assert bandwidth(layer, "theta_i") == 1
    assert curve_deviation(layer, "theta_i", 1) == pytest.approx(0.0, abs=1e-12)


def test_a_black_curve_needs_one_band() -> None:
    layer = make_layer(MODELS["lambert"], {"albedo": (0.0, 0.0, 0.0)})
    assert bandwidth(layer, "theta_i") == 1


def test_the_deviation_of_one_cosine_band_is_its_closed_form() -> None:
    # Phong with exponent 1 is a multiple of cos, its mean by solid angle over [0, pi/2] half of that. The running
    # integrals sin^2/2 and (1 - cos)/2 differ most where cos = 1/2: 3/8 - 1/4 = 1/8 of a total of 1/2.
    layer = make_layer(MODELS["phong"], {"exponent": 1.0})
    assert curve_deviation(layer, "theta_r", 1) == pytest.approx(0.25, rel=1e-4)


def test_deviation_falls_faster_than_the_square_of_the_bands() -> None:
    # Twice as many bands are less than a fifth of the deviation once they are narrower than the lobe (0.3 rad).
    deviations = [curve_deviation(conductor(0.3), "theta_h", n) for n in (8, 16, 32)]
    assert deviations[0] > 5 * deviations[1] > 25 * deviations[2] > 0.0


@settings(deadline=None, max_examples=6)
@given(alpha=st.floats(1e-3, 1.0))
def test_the_least_bandwidth_within_the_tolerance_is_taken(alpha: float) -> None:
    layer = conductor(alpha)
    n_bands = bandwidth(layer, "theta_h")
    if n_bands < MOST_BANDS:
        assert curve_deviation(layer, "theta_h", n_bands) <= BANDWIDTH_TOLERANCE
    assert n_bands == 1 or curve_deviation(layer, "theta_h", n_bands // 2) > BANDWIDTH_TOLERANCE


def test_sharper_lobes_need_more_bands() -> None:
    counts = [bandwidth(conductor(alpha), "theta_h") for alpha in (1.0, 0.3, 0.1, 0.01)]
    assert counts == sorted(counts) and counts[0] <= 16 and counts[-1] == MOST_BANDS


@pytest.mark.parametrize("name", sorted(MODELS))
def test_editable_layers_have_room_for_edits(name: str) -> None:
    layer = make_layer(MODELS[name])
    for factor in layer.model.factors:
        needed = bandwidth(layer, factor.name)
        assert band_counts(layer)[factor.name] == max(EDITABLE_BANDS[factor.gamma], needed)
    assert max(band_counts(layer, most=8).values()) == 8


def plan(scene: Scene, layers: dict[str, Layer], **settings: object) -> Plan:
    return plan_scene(scene, layers, **{"has_sky": True, **settings})  # type: ignore[arg-type]


def _values(plan: Plan) -> Iterator[tuple[str, str]]:
    return ((line, value) for line, value, _ in plan_lines(plan))


def test_bands_are_kept_of_what_may_be_edited(scene: Scene, layers: dict[str, Layer]) -> None:
    mixed = plan(scene, layers, editable=("ball.1",))
    # Both are computed alike, so that a layer looks the same whether or not it is editable.
    assert mixed.layer("ball.0").bands == (16,) and mixed.layer("ball.0").shape == (16, 1)
    assert mixed.layer("ball.1").bands == tuple(band_counts(layers["ball.1"]).values())
    values = {line: value for line, value, _ in plan_lines(mixed)}
    assert values["ball.0.theta_i"] == "16 bands, not stored" and values["ball.1.theta_h"] == "64 bands"
    assert bandwidth(layers["ball.1"], "theta_h") < EDITABLE_BANDS[THETA_H]
    reasons = {line: reason for line, _, reason in plan_lines(mixed)}
    assert reasons["ball.0.theta_i"] == "as finely as if it were editable"
    assert reasons["ball.1.theta_h"] == "room for edits"


def test_light_and_shadow_follow_the_scene(scene: Scene, layers: dict[str, Layer]) -> None:
    shines, few = bool(scene.emitters.any()), RenderSettings(n_lights=400)
    bright = plan(scene, layers)
    chosen = bright.settings
    assert chosen.keeps_sphere and chosen.n_lights == 4000 and bool(chosen.n_patches) == shines
    dark = plan(scene, layers, has_sky=False).settings
    # No sky: nothing is far enough away to need shadows in every direction.
    assert not dark.keeps_sphere and dark.n_lights == 0 and bool(dark.n_patches) == shines
    # In an editor shadows outlive what is lit; a still of few lights asks for theirs alone.
    assert plan(scene, layers, settings=few).settings.keeps_sphere
    assert not plan(scene, layers, settings=few, still=True).settings.keeps_sphere
    assert chosen.n_bounces == AS_PLANNED and dict(_values(bright))["bounces"] == "to be planned"


def test_every_line_can_be_overridden(scene: Scene, layers: dict[str, Layer]) -> None:
    overrides: dict[str, int | str] = {
        "ball.1.theta_h": 8, "ball.1.theta_d": 4, "lights": 100, "sphere": 0, "bounces": 3, "precision": "float",
        "edges": "off",
    }  # fmt: skip
    changed = plan(scene, layers, overrides=overrides)
    assert changed.layer("ball.1").bands == (8, 4)
    chosen = changed.settings
    assert (chosen.n_lights, chosen.keeps_sphere, chosen.n_bounces, chosen.precision) == (100, False, 3, "float")
    assert changed.n_edge_rays == 0 and changed.settings.overridden == set(overrides)
    reasons = {name: reason for name, _, reason in plan_lines(changed)}
    assert all(reasons[line] == "overridden" for line in overrides)
    assert plan(scene, layers, overrides={"ball.0.theta_i": 512}).layer("ball.0").bands == (512,)


def test_the_sphere_goes_by_the_lights_that_the_user_wants(scene: Scene, layers: dict[str, Layer]) -> None:
    assert not plan(scene, layers, still=True, overrides={"lights": 100}).settings.keeps_sphere
    assert plan(scene, layers, still=True, overrides={"sphere": 1, "lights": 100}).settings.keeps_sphere
    assert not plan(scene, layers, overrides={"sphere": 0}).settings.keeps_sphere


@pytest.mark.parametrize(
    ("line", "value", "said"),
    [
        ("ball.1.theta_h", 48, "power of two from 1 to 128"),
        ("ball.1.theta_d", 256, "power of two from 1 to 128"),
        ("ball.1.theta_h", True, "power of two"),
        ("ball.1.theta_h", "many", "power of two"),
        ("lights", 3, "20 to 80,000"),
        ("sphere", 2, "0 or 1"),
        ("precision", "quarter", "half or float"),
        ("bounces", 9, "1 to 8"),
        ("bounces", "many", "a whole number"),
        ("ball.2.theta_h", 8, "lines are: ball.0.theta_i, ball.1.theta_h"),
    ],
)
def test_what_cannot_be_is_refused(
    scene: Scene, layers: dict[str, Layer], line: str, value: int | str, said: str
) -> None:
    with pytest.raises(InsituError, match=said):
        plan(scene, layers, overrides={line: value})


def test_the_pilot_estimates_what_the_work_takes(scene: Scene, layers: dict[str, Layer]) -> None:
    from engine.core.generators import run_to_end
    from engine.light.environment import constant_environment
    from engine.precompute.direct.bandstore import join_tiles
    from engine.precompute.direct.pipeline import FINAL, Placement, SkyState
    from engine.precompute.direct.projection import LayerShape, project_layer
    from engine.render.cost_pilot import estimate_cost
    from engine.render.still import still_layers

    placement, sky = Placement(scene), SkyState(constant_environment(1.0))
    planned = plan(scene, layers, settings=RenderSettings(FINAL.n_lights), editable=("ball.1",))
    works = still_layers(layers.items(), ("ball", "lamp"), planned)
    before = placement.sphere.done.copy()
    cost = run_to_end(estimate_cost(placement, works, sky, planned), lambda step: None).cost
    assert cost is not None and np.array_equal(placement.sphere.done, before)
    assert cost.seconds > cost.visibility_seconds > 0.0 and cost.indirect_seconds == 0.0
    # All points are sampled in so small a picture: bytes are those of the real transport, plus the sphere's bits.
    light = run_to_end(placement.light(sky, FINAL))
    n_bytes = placement.sphere.bits.nbytes
    for each in works:
        shape = LayerShape(each.layer.model.name, tuple(each.layer.quotient_parameters().tolist()), each.bands)
        tiles = project_layer(placement.hits, placement.rows_of(each.i_object), light, shape)
        store = join_tiles(shape.bands, tiles)
        # Of the layer that is not editable its picture alone is kept: three single floats a point.
        n_bytes += store.n_bytes if each.editable else 12 * store.n_points
    assert cost.disk_mib == pytest.approx(n_bytes / 2**20, rel=0.05)
    n_points = len(placement.rows_of(0))
    widest = max(planned.layer("ball.1").bands)
    # A mix of eight lights keeps three single floats a point for each, and three more of such pictures.
    mixed = run_to_end(estimate_cost(placement, works, sky, planned, n_lights=8), lambda step: None).cost
    n_all = sum(len(placement.rows_of(each.i_object)) for each in works)
    assert mixed is not None and mixed.editing_mib - cost.editing_mib == pytest.approx(
        11 * 12 * n_all / 2**20, rel=0.01
    )
    # Three half floats a coefficient of the widest curve, and 16 bytes for each layer's accumulator.
    assert cost.gpu_mib == pytest.approx((widest * 3 * 2 + 2 * 16) * n_points / 2**20)
