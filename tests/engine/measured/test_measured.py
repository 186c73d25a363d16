"""From samples to layers: gaps are filled, factors fitted, and an unedited import equals the measurement."""

import pickle
from collections.abc import Callable, Mapping
from pathlib import Path
from threading import Barrier, Thread
from typing import Any

import numpy as np
import pytest

from engine.core.errors import InsituError, LoadError
from engine.core.generators import run_to_end
from engine.core.stored_arrays import UnsoundArrays
from engine.light.environment import load_environment
from engine.material import MODELS, make_layer
from engine.material._kernels import model_quotient_cosine
from engine.material.kinds import CHANNEL
from engine.material.layer import Layer, evaluate_by_curves
from engine.measured import tables
from engine.measured.fit import fit_factors
from engine.measured.measurement import CURVES, Measurement, above_horizon, evaluate_table, node_angles
from engine.measured.tables import read_measurement, table_of
from engine.planner import plan_scene
from engine.precompute.direct._angle_kernels import tint
from engine.precompute.direct.pipeline import Placement, SkyState
from engine.render.still import render_reference, render_still, still_layers, still_quality
from engine.scene.scene_loader import load_scene
from tests.engine.forging import forged_numbers, forged_shapes
from tests.naive.measured import analytic_samples, drawn_measurement
from tests.scene_text import camera, placed, scaled


class Kept:
    """A store in memory."""

    def __init__(self) -> None:
        self.arrays: dict[str, Mapping[str, np.ndarray]] = {}
        self.n_refused = 0

    def get(self, key: str, read: Callable[[Mapping[str, np.ndarray]], Any]) -> Any:
        try:
            return read(self.arrays[key]) if key in self.arrays else None
        except UnsoundArrays:
            self.n_refused += 1
            return None

    def put(self, key: str, arrays: Mapping[str, np.ndarray]) -> bool:
        self.arrays[key] = dict(arrays)
        return True


@pytest.fixture(scope="module")
def kept() -> Kept:
    return Kept()


@pytest.fixture(scope="module")
def measurement(merl_file: Path, kept: Kept) -> Measurement:
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(tables, "_tables", {})
        run_to_end(read_measurement(merl_file, kept))
    return run_to_end(read_measurement(merl_file, kept))


OTHER_HIGHLIGHTS = ("measured_around", "measured_twist", "measured_brushed")


def both_parts(measurement: Measurement, **parameters: object) -> list[Layer]:
    return [make_layer(MODELS[name], {"file": measurement, **parameters}) for name in ("measured_diffuse", "measured")]


def hemisphere(count: int, seed: int) -> np.ndarray:
    v = np.random.default_rng(seed).normal(size=(count, 3))
    v[:, 2] = np.abs(v[:, 2])
    return v / np.linalg.norm(v, axis=1, keepdims=True)


def relative_rmse(picture: np.ndarray, reference: np.ndarray) -> float:
    cap = np.percentile(reference, 99.9)
    picture, reference = np.minimum(picture, cap), np.minimum(reference, cap)
    return float(np.sqrt(np.mean((picture - reference) ** 2)) / reference.mean())


def test_gaps_are_filled_and_counted(measured_samples: np.ndarray, measurement: Measurement) -> None:
    # All that is negative is filled; what was measured stays; a gap is about as bright as beside it (noise is 5 %).
    samples, table = measured_samples, table_of(measurement.number).samples
    there = (samples >= 0.0).all(axis=-1)
    assert (table >= 0.0).all()
    np.testing.assert_allclose(table[there], samples[there], rtol=1e-6)
    gaps = ~there & above_horizon()
    report = measurement.report
    assert report is not None and (report.n_missing, report.n_below) == (gaps.sum(), (~above_horizon()).sum())
    assert np.abs(np.log(table[gaps] / analytic_samples()[gaps])).mean() < 0.08


def test_nothing_measured_is_refused(tmp_path: Path) -> None:
    from engine.measured.sample_files import merl_bytes

    path = tmp_path / "x.binary"
    path.write_bytes(merl_bytes(np.full((90, 90, 180, 3), -1.0, np.float32)))
    with pytest.raises(LoadError, match="samples = all negative, expected some that are not"):
        run_to_end(read_measurement(path))
    with pytest.raises(LoadError, match=r"name = \.txt, expected a measured BRDF"):
        run_to_end(read_measurement(tmp_path / "x.txt"))


def test_factors_of_a_product_are_found() -> None:
    # Matt 0.1 plus exp(-30 tan²) (0.2 + 0.8 theta_d / 90°): both strengths and both curves, to a few percent.
    theta_h, theta_d = node_angles(True)[:-1], np.arange(90.0) / 90.0
    shine = np.exp(-30.0 * np.tan(theta_h) ** 2)[:, None] * (0.2 + 0.8 * theta_d)
    table = np.broadcast_to((0.1 + shine)[:, :, None, None], (90, 90, 180, 3)).astype(np.float32)
    *_, factors = fit_factors(table, above_horizon())
    assert not isinstance(factors, float)
    assert factors.strengths["diffuse"] == pytest.approx(np.full(3, 0.1), rel=0.05)
    assert factors.curves["theta_i"].min() > 0.9
    expected = shine[:, 45] / shine[0, 45]
    np.testing.assert_allclose(factors.curves["theta_h"][:-1, 0], expected, atol=0.01)
    assert factors.curves["theta_d"][20, 0] / factors.curves["theta_d"][70, 0] == pytest.approx(
        shine[0, 20] / shine[0, 70], rel=0.03
    )
    assert factors.error < 0.05


@pytest.mark.parametrize("smoothing", [0.0, 0.5])
def test_unedited_layers_are_the_measurement(measurement: Measurement, smoothing: float) -> None:
    # Curves times compiled quotients, both parts together, against the interpolated table: to 1e-5 over random pairs.
    wi, wo = hemisphere(20_000, 3), hemisphere(20_000, 4)
    layers = both_parts(measurement, smoothing=smoothing)
    expected = evaluate_table(table_of(measurement.number).samples, wi, wo)
    np.testing.assert_allclose(sum(layer.brdf(wi, wo) for layer in layers), expected, rtol=1e-12)
    cloth = make_layer(MODELS["measured_cloth"], {"file": measurement, "smoothing": smoothing})
    others = [make_layer(MODELS[name], {"file": measurement, "smoothing": smoothing}) for name in OTHER_HIGHLIGHTS]
    for terms in (layers, [cloth], *([layers[0], other] for other in others)):
        found = sum(layer.scale() * evaluate_by_curves(layer, wi, wo) for layer in terms) / wi[:, 2:]
        np.testing.assert_allclose(found, expected, rtol=1e-5)


@pytest.mark.parametrize("name", ["measured_diffuse", "measured", "measured_cloth", *OTHER_HIGHLIGHTS])
def test_the_colours_of_many_directions_are_those_of_each(measurement: Measurement, name: str) -> None:
    # What the projection looks up at once against one direction and one colour after the other: but for rounding.
    model = MODELS[name]
    layer = make_layer(model, {"file": measurement})
    q, wi, wo = np.array(model.bind_parameters(layer.quotient_parameters())), hemisphere(200, 6), hemisphere(1, 7)[0]
    wi[:20] = wo * [-1, -1, 1] + 1e-3 * hemisphere(20, 8)  # about the highlight's tip
    wi[20:40, 2] *= -1.0
    x, y, z = np.ascontiguousarray(wi.T, np.float32)
    ones, found = np.ones((200, 3), np.float32), np.empty((200, 3), np.float32)
    lights, weights, o = np.arange(200), np.ones(200, np.float32), wo.astype(np.float32)
    tint(model.colours_number(q), q, lights, x, y, z, *o, weights, ones, np.empty_like(ones), found)
    for channel in range(3):
        q[CHANNEL] = channel
        pairs = np.column_stack([x, y, z, np.tile(o, (200, 1))]).astype(float)
        one_by_one = [model_quotient_cosine(model.number, q, *pair) for pair in pairs]
        np.testing.assert_allclose(found[:, channel], one_by_one, rtol=1e-6, atol=1e-12)
    assert not found[20:40].any()


def test_a_layer_is_a_small_value(measurement: Measurement) -> None:
    # It travels by pickling, compares and hashes, and says so where its table is not.
    layer = both_parts(measurement)[1]
    data = pickle.dumps(layer)
    again = pickle.loads(data)
    assert len(data) < 15_000 and again == layer and hash(measurement) == hash(again.values["file"])
    stranger = make_layer(MODELS["measured"], {"file": drawn_measurement()})
    with pytest.raises(InsituError, match="has not been read"):
        evaluate_by_curves(stranger, hemisphere(1, 1), hemisphere(1, 2))


def test_what_was_made_of_a_file_is_kept(
    merl_file: Path, measurement: Measurement, kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    # The store is asked by the file's content; what comes from it is the same measurement, and nothing is fitted.
    monkeypatch.setattr(tables, "_tables", {})
    monkeypatch.delattr(tables, "fit_factors")
    assert run_to_end(read_measurement(merl_file, kept)) == measurement and len(kept.arrays) == 1


def test_what_was_forged_is_made_again(
    merl_file: Path, measurement: Measurement, kept: Kept, monkeypatch: pytest.MonkeyPatch
) -> None:
    def made_again(*_: object) -> None:
        raise LookupError("made again")

    monkeypatch.setattr(tables, "_tables", {})
    monkeypatch.setattr(tables, "_fit_file", made_again)
    ((key, arrays),) = kept.arrays.items()
    forgeries = [*forged_shapes(arrays), *forged_numbers({"samples": arrays["samples"], "curves": arrays["curves"]})]
    for what, forged in forgeries[::4]:
        if not what.startswith("method with a row"):  # any words will do
            store = Kept()
            store.put(key, {**arrays, **forged} if "[" in what else forged)
            with pytest.raises(LookupError, match="made again"):
                run_to_end(read_measurement(merl_file, store))
            assert store.n_refused == 1, what


def test_threads_share_the_factors_that_kernels_read(measurement: Measurement, monkeypatch: pytest.MonkeyPatch) -> None:
    # Two threads find nothing made yet, and make it at once: what the first one's kernels read is not freed.
    table, barrier, nodes, found = table_of(measurement.number), Barrier(2), Measurement.nodes, []

    def slow_nodes(self: Measurement, name: str, smoothing: float = 0.0) -> np.ndarray:
        if name == CURVES[0]:
            barrier.wait(10.0)
        return nodes(self, name, smoothing)

    monkeypatch.setattr(Measurement, "nodes", slow_nodes)
    threads = [Thread(target=lambda: found.append(table.curves(0.321))) for _ in range(2)]
    for thread in threads:
        thread.start()
    for thread in threads:
        thread.join()
    assert len(found) == 2 and found[0] is found[1] is table.curves(0.321)


def bunny_under_galileo(tmp_path: Path, layers: list[Layer], data: Path, size: int) -> tuple[np.ndarray, np.ndarray]:
    """The pixels of the bunny: by transport, and by brute force over 20,480 directions with the table itself."""
    bunny = data / "meshes" / "bunny.ply"
    (tmp_path / "bunny.ply").write_bytes(bunny.read_bytes())
    view = camera((0.2, 1.0, 2.4), resolution=(size, size), target=(0.0, 0.45, 0.0))
    (tmp_path / "scene.toml").write_text(view + placed("bunny", "bunny.ply", scaled(8, (0.15, -0.3, 0))))
    placement = Placement(load_scene(tmp_path / "scene.toml"))
    sky = SkyState(load_environment(data / "probes" / "galileo_probe.hdr", "angular"))
    named = {f"bunny.{i}": layer for i, layer in enumerate(layers)}
    plan = plan_scene(placement.scene, named, has_sky=True, still=True)
    steps = render_still(placement, still_layers(named.items(), ["bunny"], plan), sky, still_quality(plan))
    picture = run_to_end(steps, lambda step: None)
    reference = run_to_end(render_reference(placement, {0: layers}, sky, 16, 5), lambda step: None)
    seen = placement.hits.object_image == 0
    assert seen.sum() > 40
    return picture[seen], reference[seen]


def test_picture_of_an_unedited_import(tmp_path: Path, measurement: Measurement, shared_data: Path) -> None:
    # Within 1 % of the measurement evaluated directly, the colour of the quotient included.
    picture, reference = bunny_under_galileo(tmp_path, both_parts(measurement), shared_data, 14)
    assert relative_rmse(picture, reference) < 0.01
