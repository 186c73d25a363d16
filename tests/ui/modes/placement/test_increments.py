"""Increments on the GPU against the sum itself, B = Σ_k c_k T_k in float64 on the same stored numbers."""

import numpy as np
import pytest

from tests.ui.gl.pictures import contracted, finish, norms_of, relative_error, start_layer
from ui.gl.context import GraphicsError
from ui.modes.placement.gl.renderer import PlacementRenderer
from ui.modes.placement.gl.transport import TransportUpload

pytestmark = pytest.mark.gl


def _problem(n_bands: int, n_samples: int, seed: int = 1) -> tuple[np.ndarray, np.ndarray, np.random.Generator]:
    """Transport like a real one, coarse bands strong and fine ones weak, in numbers that halves hold exactly."""
    rng = np.random.default_rng(seed)
    strength = 2.0 ** -np.arange(n_bands).clip(0, 8).astype(np.float32)
    transport = rng.normal(size=(n_bands, n_samples, 3)).astype(np.float32) * strength[:, None, None]
    return transport.astype(np.float16).astype(np.float32), rng.normal(size=(n_bands, 3)), rng


def rebase(renderer: PlacementRenderer) -> bool:
    """As where drift makes it due: the coming updates sum from zero; False when a transport is not the picture's."""
    states = [active.refiner.state for active in renderer._edited._active.values()]
    for state in states:
        if state.may_rebuild:
            state.shown = None
    return bool(states) and all(state.may_rebuild for state in states)


@pytest.mark.parametrize("precision", ["half", "float"])
@pytest.mark.parametrize(("n_bands", "n_samples"), [(1, 1), (2, 7), (16, 1024), (128, 1025), (256, 40), (64, 3000)])
def test_a_rebuild_is_the_sum(renderer: PlacementRenderer, n_bands: int, n_samples: int, precision: str) -> None:
    transport, coefficients, _ = _problem(n_bands, n_samples)
    start_layer(renderer, transport, coefficients, precision)
    # Halves hold these numbers exactly (the scale is a power of two), so both precisions differ by float32 sums only.
    image = renderer.layer_radiance("ball.0")
    assert relative_error(image, contracted(transport, coefficients)) < 1e-6


@pytest.mark.parametrize("precision", ["half", "float"])
def test_increments_equal_recomputation_after_each_edit(renderer: PlacementRenderer, precision: str) -> None:
    transport, coefficients, rng = _problem(32, 1500)
    start_layer(renderer, transport, coefficients, precision)
    for _ in range(40):
        chosen = rng.choice(32, 5, replace=False)
        coefficients[chosen] += rng.normal(size=(5, 3)) * 10.0 ** rng.uniform(-3, 1)
        renderer.want("ball.0", coefficients)
        renderer.update()
        assert relative_error(renderer.layer_radiance("ball.0"), contracted(transport, coefficients)) < 1e-5


def test_few_terms_a_frame_reach_the_same_picture(renderer: PlacementRenderer) -> None:
    transport, coefficients, rng = _problem(64, 500)
    start_layer(renderer, transport, coefficients)
    coefficients += rng.normal(size=(64, 3))
    renderer.want("ball.0", coefficients)
    target, errors = contracted(transport, coefficients), []
    for _ in range(7):  # seven times ten terms are more than 64
        report = renderer.update(max_coefficients=10)
        errors.append(relative_error(renderer.layer_radiance("ball.0"), target))
    assert report.remaining == 0 and errors[-1] < 1e-5
    assert errors[0] < 0.5 and all(late < early for early, late in zip(errors, errors[1:], strict=False))


def test_the_estimated_error_is_the_true_one_for_orthogonal_terms(renderer: PlacementRenderer) -> None:
    # Term k lights sample k alone, so its norm is exactly its effect; the mean radiance is that of what is shown.
    transport = np.zeros((8, 8, 3), dtype=np.float32)
    transport[np.arange(8), np.arange(8)] = 1.0
    start_layer(renderer, transport, np.full((8, 3), 2.0))
    wanted = np.full((8, 3), 2.0)
    wanted[:4] = [[5.0] * 3, [4.0] * 3, [3.0] * 3, [2.5] * 3]
    renderer.want("ball.0", wanted)
    report = renderer.update(max_coefficients=2)
    # Left are 1 and 0.5 in 8 samples: sqrt(1.25 / 8). The samples are now 5, 4 and six times 2.
    assert report.applied == 2 and report.remaining == 2
    assert report.image_error == pytest.approx(np.sqrt(1.25 / 8) / (21 / 8), rel=1e-6)


def test_an_edit_and_its_inverse_restore_the_picture(renderer: PlacementRenderer) -> None:
    transport, coefficients, rng = _problem(32, 2000)
    start_layer(renderer, transport, coefficients)
    before = renderer.layer_radiance("ball.0").astype(np.float64)
    for magnitude in (1e-3, 1.0, 10.0, 1e3):
        for change in (magnitude, -magnitude):
            coefficients[:9] += change
            renderer.want("ball.0", coefficients)
            renderer.update()
        finish(renderer)
        assert relative_error(renderer.layer_radiance("ball.0"), before) < 1e-6


def test_a_time_budget_limits_the_terms_of_a_frame(renderer: PlacementRenderer) -> None:
    transport, coefficients, rng = _problem(128, 4000)
    start_layer(renderer, transport, coefficients)
    coefficients += rng.normal(size=(128, 3))
    renderer.want("ball.0", coefficients)
    # A nanosecond is not enough for any term, and one is added all the same; an hour is enough for all.
    assert renderer.update(budget_s=1e-9).applied == 1
    assert renderer.update(budget_s=3600.0).remaining == 0
    finish(renderer)
    assert relative_error(renderer.layer_radiance("ball.0"), contracted(transport, coefficients)) < 1e-5


@pytest.mark.parametrize("n_frames", [400, pytest.param(4_000, marks=pytest.mark.sweep)])
def test_edits_drift_no_further_than_1e_5(renderer: PlacementRenderer, n_frames: int) -> None:
    # Float32 accumulators without a rebase end 4e-5 off (EXTREMES.md); magnitudes 1e-3 to 1e3, 25 edits a frame.
    transport, coefficients, rng = _problem(16, 64)
    start_layer(renderer, transport, coefficients)
    worst = 0.0
    for i_frame in range(n_frames):
        for _ in range(25):
            coefficients[rng.integers(16)] = rng.normal(size=3) * 10.0 ** rng.uniform(-3, 3)
            renderer.want("ball.0", coefficients)
        renderer.update(max_coefficients=8)
        if i_frame % 200 == 199:
            while renderer.update(max_coefficients=8).remaining:
                pass
            image = renderer.layer_radiance("ball.0")
            worst = max(worst, relative_error(image, contracted(transport, coefficients)))
    assert worst < 1e-5


def test_weak_and_strong_bands_survive_in_half(renderer: PlacementRenderer) -> None:
    # 1e8 is far above what a half holds (65504) and 1e-8 far below its smallest normal (6e-5): one scale a band.
    rng = np.random.default_rng(3)
    transport = rng.uniform(0.5, 1.0, (3, 200, 3)).astype(np.float32)
    strength = np.array([1e8, 1.0, 1e-8])
    transport *= strength.astype(np.float32)[:, None, None]
    start_layer(renderer, transport, np.zeros((3, 3)), "half")
    for k in range(3):
        alone = np.zeros((3, 3))
        alone[k] = 1.0 / strength[k]
        renderer.want("ball.0", alone)
        rebase(renderer)
        finish(renderer)
        # Halves between 0.5 and 1 times a power of two are good to 2^-12.
        error = renderer.layer_radiance("ball.0") - contracted(transport, alone)
        assert np.abs(error).max() < 2.0**-11


def test_scales_of_the_worker_are_applied(renderer: PlacementRenderer) -> None:
    transport, coefficients, _ = _problem(8, 100)
    scale = 10.0 ** np.arange(-4, 4)
    stored = transport.astype(np.float16)
    start_layer(renderer, transport, coefficients)
    renderer.begin_transport("ball.0", stored, norms_of(transport) * scale[:, None], scale)
    assert renderer.upload(1.0)
    finish(renderer)
    expected = contracted(transport * scale[:, None, None], coefficients)
    assert relative_error(renderer.layer_radiance("ball.0"), expected) < 1e-6


def test_the_precision_is_that_of_the_transport_in_use(renderer: PlacementRenderer) -> None:
    transport, coefficients, _ = _problem(8, 100)
    assert renderer.transport_precision is None
    start_layer(renderer, transport, coefficients, "half")
    renderer.begin_transport("ball.0", transport, norms_of(transport))
    renderer.upload(0.0)
    assert renderer.transport_precision == "half"  # the new one is not there yet
    assert renderer.upload(1.0) and renderer.transport_precision == "float"


def test_a_partial_upload_is_never_shown(renderer: PlacementRenderer) -> None:
    transport, coefficients, _ = _problem(16, 300)
    start_layer(renderer, transport, coefficients)
    before = renderer.layer_radiance("ball.0")
    brighter = 3.0 * transport
    renderer.begin_transport("ball.0", brighter, norms_of(brighter))
    for i_slice in range(15):
        assert not renderer.upload(0.0)  # no time at all is one coefficient
        assert renderer.upload_fraction == pytest.approx((i_slice + 1) / 16)
        renderer.update()
        np.testing.assert_array_equal(renderer.layer_radiance("ball.0"), before)
    assert renderer.upload(0.0) and renderer.upload_fraction is None
    np.testing.assert_array_equal(renderer.layer_radiance("ball.0"), before)
    finish(renderer)
    # Three times the transport under the same curve is three times the picture.
    np.testing.assert_allclose(renderer.layer_radiance("ball.0"), 3.0 * before, rtol=1e-5, atol=1e-5)


def test_edits_go_on_while_a_transport_is_uploaded(renderer: PlacementRenderer) -> None:
    transport, coefficients, _ = _problem(16, 300)
    start_layer(renderer, transport, coefficients)
    renderer.begin_transport("ball.0", transport, norms_of(transport))
    renderer.upload(0.0)
    coefficients[3] += 1.0
    renderer.want("ball.0", coefficients)
    finish(renderer)
    assert relative_error(renderer.layer_radiance("ball.0"), contracted(transport, coefficients)) < 1e-6


def test_a_transport_with_a_nan_is_refused_and_the_picture_stays(renderer: PlacementRenderer) -> None:
    transport, coefficients, _ = _problem(8, 50)
    start_layer(renderer, transport, coefficients)
    before, bytes_before = renderer.layer_radiance("ball.0"), renderer.memory_bytes
    for dtype, bad in ((np.float16, np.nan), (np.float16, np.inf), (np.float32, np.nan)):
        broken = transport.astype(dtype)
        broken[5, 17, 1] = bad
        renderer.begin_transport("ball.0", broken, norms_of(transport))
        with pytest.raises(GraphicsError, match="coefficient 5"):
            renderer.upload(10.0)
        assert renderer.upload_fraction is None and renderer.memory_bytes == bytes_before
        renderer.update()
        np.testing.assert_array_equal(renderer.layer_radiance("ball.0"), before)


def test_wrong_curves_and_transports_are_refused(renderer: PlacementRenderer) -> None:
    transport, coefficients, _ = _problem(8, 50)
    start_layer(renderer, transport, coefficients)
    with pytest.raises(GraphicsError, match="finite"):
        renderer.want("ball.0", np.full((8, 3), np.nan))
    with pytest.raises(GraphicsError, match="1e36"):
        renderer.want("ball.0", np.full((8, 3), 1e300))
    with pytest.raises(GraphicsError, match="expected 50"):
        renderer.begin_transport("ball.0", transport[:, :20], norms_of(transport))
    with pytest.raises(GraphicsError, match=r"expected \(J, p, 3\)"):
        renderer.begin_transport("ball.0", transport[0], norms_of(transport))
    with pytest.raises(GraphicsError, match="float64, expected float16 or float32"):
        renderer.begin_transport("ball.0", transport.astype(float), norms_of(transport))
    with pytest.raises(GraphicsError, match="no layer cup.0"):
        renderer.begin_transport("cup.0", transport, norms_of(transport))


def test_a_transport_too_large_keeps_picture_and_transport(renderer: PlacementRenderer) -> None:
    transport, coefficients, _ = _problem(8, 50)
    start_layer(renderer, transport, coefficients)
    before = renderer.layer_radiance("ball.0")
    renderer.memory.limit = renderer.memory_bytes + 1000
    with pytest.raises(GraphicsError, match="exceed the limit"):
        renderer.begin_transport("ball.0", transport, norms_of(transport))
    renderer.memory.limit = None
    np.testing.assert_array_equal(renderer.layer_radiance("ball.0"), before)
    coefficients[0] += 1.0
    renderer.want("ball.0", coefficients)
    finish(renderer)
    assert relative_error(renderer.layer_radiance("ball.0"), contracted(transport, coefficients)) < 1e-6


def test_a_new_picture_makes_the_old_transport_stale(renderer: PlacementRenderer) -> None:
    transport, coefficients, _ = _problem(8, 50)
    start_layer(renderer, transport, coefficients)
    other = 2.0 * contracted(transport, coefficients)
    renderer.set_layer_radiance("ball.0", other, coefficients)
    assert renderer.update().exact and not rebase(renderer)
    np.testing.assert_allclose(renderer.layer_radiance("ball.0"), other, rtol=1e-6)
    # An edit is still followed, by increments of the old transport on top of the new picture.
    coefficients[2] += 1.0
    renderer.want("ball.0", coefficients)
    renderer.update()
    assert relative_error(renderer.layer_radiance("ball.0"), other + transport[2]) < 1e-6


def test_a_rebuild_on_request_goes_in_chunks_and_shows_when_complete(renderer: PlacementRenderer) -> None:
    transport, coefficients, _ = _problem(256, 30)
    start_layer(renderer, transport, coefficients)
    before = renderer.layer_radiance("ball.0")
    assert rebase(renderer)
    # A due rebuild takes 32 terms a step where fewer are allowed, and no more, so that no frame is long: eight steps.
    for _ in range(7):
        assert renderer.update(max_coefficients=5).applied == 32
        np.testing.assert_array_equal(renderer.layer_radiance("ball.0"), before)
    assert renderer.update(max_coefficients=5).exact
    np.testing.assert_allclose(renderer.layer_radiance("ball.0"), before, rtol=1e-4, atol=1e-5)


def test_layers_that_share_a_curve_follow_in_one_update(renderer: PlacementRenderer) -> None:
    # Transports of two layers, of other bands and samples, arrive one after the other and stay; a third drops them.
    first, coefficients, rng = _problem(16, 300)
    second, others, _ = _problem(32, 300, seed=2)
    start_layer(renderer, first, coefficients)
    renderer.set_layer("ball.1", 0, 300)
    renderer.begin_transport("ball.1", second, norms_of(second), beside=("ball.0", "ball.1"))
    renderer.want("ball.1", others)
    while not renderer.upload(1.0):
        pass
    finish(renderer)
    for _ in range(5):
        coefficients, others = coefficients + rng.normal(size=(16, 3)), others + rng.normal(size=(32, 3))
        renderer.want("ball.0", coefficients)
        renderer.want("ball.1", others)
        report = renderer.update(max_coefficients=8)
        assert report.applied == 16 and 24 <= report.remaining < 32 and report.image_error > 0.0 and not report.exact
        assert renderer.update().remaining == 0
        assert relative_error(renderer.layer_radiance("ball.0"), contracted(first, coefficients)) < 1e-5
        assert relative_error(renderer.layer_radiance("ball.1"), contracted(second, others)) < 1e-5
    assert renderer._edited.keys == ("ball.0", "ball.1") and rebase(renderer)
    renderer.begin_transport("ball.0", first, norms_of(first))
    while not renderer.upload(1.0):
        pass
    assert renderer._edited.keys == ("ball.0",)


def test_a_transport_is_not_stepped_by_another_curve_of_as_many_bands(renderer: PlacementRenderer) -> None:
    # Between the selection of a layer's other curve and its transport the picture stays.
    transport, coefficients, _ = _problem(16, 200)
    start_layer(renderer, transport, coefficients)
    renderer.want("ball.0", coefficients + 1.0, "the other")
    assert renderer.update().applied == 0 and renderer.transport_curve("ball.0") == ""
    renderer.begin_transport("ball.0", 2.0 * transport, norms_of(2.0 * transport), curve="the other")
    while not renderer.upload(1.0):
        pass
    finish(renderer)
    assert relative_error(renderer.layer_radiance("ball.0"), contracted(2.0 * transport, coefficients + 1.0)) < 1e-5


def test_a_picture_under_a_curve_of_before_is_held_back_for_its_transport(renderer: PlacementRenderer) -> None:
    transport, coefficients, rng = _problem(16, 200)
    start_layer(renderer, transport, coefficients)
    before, finer = renderer.layer_radiance("ball.0"), transport + 0.1 * rng.normal(size=transport.shape)
    old = contracted(finer, 0.0 * coefficients).astype(np.float32)
    numbers = finer.astype(np.float32)
    # The one before goes on following the curve until it is uploaded; another transport for it changes nothing.
    renderer.begin_transport("ball.0", numbers, norms_of(finer), stage="preview", radiance=old)
    np.testing.assert_array_equal(renderer.layer_radiance("ball.0"), before)
    renderer.want("ball.0", 2.0 * coefficients)
    finish(renderer)
    assert relative_error(renderer.layer_radiance("ball.0"), contracted(transport, 2.0 * coefficients)) < 1e-5
    renderer.begin_transport("ball.0", numbers, norms_of(finer), stage="preview")
    assert relative_error(renderer.layer_radiance("ball.0"), contracted(transport, 2.0 * coefficients)) < 1e-5
    while not renderer.upload(1.0):
        assert relative_error(renderer.layer_radiance("ball.0"), contracted(transport, 2.0 * coefficients)) < 1e-5
    finish(renderer)
    assert relative_error(renderer.layer_radiance("ball.0"), contracted(finer, 2.0 * coefficients)) < 1e-5


@pytest.mark.parametrize("how", ["another layer", "fails", "no curve"])
def test_where_its_transport_cannot_be_used_it_is_shown(
    renderer: PlacementRenderer, monkeypatch: pytest.MonkeyPatch, how: str
) -> None:
    transport, coefficients, _ = _problem(16, 200)
    start_layer(renderer, transport, coefficients)
    renderer.set_layer("ball.1", 0, 200)
    held = contracted(transport, 0.5 * coefficients).astype(np.float32)
    curve = "the other" if how == "no curve" else ""
    renderer.begin_transport("ball.0", transport, norms_of(transport), curve=curve, stage="preview", radiance=held)
    if how == "another layer":
        renderer.begin_transport("ball.1", transport, norms_of(transport))
    elif how == "no curve":
        while not renderer.upload(1.0):
            pass
    else:

        def fail(upload: TransportUpload, seconds: float) -> bool:
            raise GraphicsError("no memory")

        monkeypatch.setattr(TransportUpload, "advance", fail)
        with pytest.raises(GraphicsError, match="no memory"):
            renderer.upload(1.0)
    np.testing.assert_array_equal(renderer.layer_radiance("ball.0"), held)
    renderer.want("ball.0", coefficients)
    renderer.update()  # there is no transport of these samples, or not of this curve
    np.testing.assert_array_equal(renderer.layer_radiance("ball.0"), held)
    renderer.want("ball.0", coefficients, "the other")
    finish(renderer)
    expected = contracted(transport, coefficients) if how == "no curve" else held
    assert relative_error(renderer.layer_radiance("ball.0"), expected) < 1e-5


def test_a_transport_whose_curve_was_never_wanted_leaves_the_picture(renderer: PlacementRenderer) -> None:
    # Another curve of the layer is selected before it is there, and dragged before its own transport comes.
    transport, coefficients, _ = _problem(16, 200)
    start_layer(renderer, transport, coefficients)
    before = renderer.layer_radiance("ball.0")
    renderer.begin_transport("ball.0", transport, norms_of(transport), curve="the other")
    while not renderer.upload(1.0):
        pass
    renderer.want("ball.0", 2.0 * coefficients)
    assert renderer.update().applied == 0
    np.testing.assert_array_equal(renderer.layer_radiance("ball.0"), before)
