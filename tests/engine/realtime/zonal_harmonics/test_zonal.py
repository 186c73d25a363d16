"""Zonal lobes: fitted, rotated and bounded, beside a twin that searches axes and coefficients at once with SciPy; and
membranes: the coefficients of [Sloan05, eq. 23] are what eq. 22 projects to.
"""

from __future__ import annotations

import math

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from engine.core import threads
from engine.core.generators import run_to_end
from engine.realtime.zonal_harmonics.transfer import cosine_directions
from engine.realtime.zonal_harmonics.zonal import MAX_LOBES, Zonal, fit, fit_linear_lobe, membrane
from engine.sphere.harmonics import bands, basis, rotate

# [Sloan05, figure 2]: of a random vector of order 6, with 6 lobes.
PAPERS_ERROR_6 = 0.00908

ORDER = 10
ALPHAS = np.array([0.0, 0.3, 1.0])


def random_vectors(count: int, n: int = 6) -> np.ndarray:
    vectors = np.random.default_rng(7).normal(size=(count, n * n))
    return vectors / np.linalg.norm(vectors, axis=1)[:, None]


def lobes(axes: np.ndarray, coefficients: np.ndarray) -> np.ndarray:
    """Vectors (P, n^2) of lobes about axes (P, N, 3) with coefficients (P, N, n)."""
    return np.einsum("pik,pik->pk", basis(axes, 6), coefficients[:, :, bands(6)])


def fitted(vectors: np.ndarray, n_lobes: int, n_restarts: int = 4) -> Zonal:
    return run_to_end(fit(vectors, n_lobes, n_restarts))


@pytest.mark.parametrize("n_lobes", range(1, MAX_LOBES + 1))
def test_what_the_error_says_is_what_is_left(n_lobes: int) -> None:
    vectors = random_vectors(20)
    zonal = fitted(vectors, n_lobes)
    left = zonal.harmonics() - vectors
    assert zonal.errors == pytest.approx(np.linalg.norm(left, axis=1), abs=1e-12)
    assert np.linalg.norm(zonal.axes, axis=2) == pytest.approx(1.0, abs=1e-12)
    assert np.abs(left[:, : 4 if n_lobes >= 3 else 1]).max() == 0.0  # kept as they are


def test_six_lobes_are_no_worse_than_the_papers() -> None:
    vectors = random_vectors(60)
    errors = [np.sqrt((fitted(vectors, n).errors ** 2).mean()) for n in range(1, MAX_LOBES + 1)]
    assert all(more < fewer for fewer, more in zip(errors, errors[1:], strict=False))
    assert errors[-1] < PAPERS_ERROR_6


@pytest.mark.parametrize("n_lobes", [1, 2, 3])
def test_lobes_are_found_again(n_lobes: int) -> None:
    rng = np.random.default_rng(3)
    axes = rng.normal(size=(10, n_lobes, 3))
    axes /= np.linalg.norm(axes, axis=2)[:, :, None]
    vectors = lobes(axes, rng.uniform(0.5, 1.0, (10, n_lobes, 6)))
    assert np.median(fitted(vectors, n_lobes, 20).errors) < 1e-4


def test_a_lobe_about_the_linear_band_is_the_best_of_what_is_round_about_it() -> None:
    """A cosine that is turned is found again, all but its constant band, which is kept; of others the error is told."""
    round_about = cosine_directions(4000, 6)[1].mean(axis=0)
    turns = Rotation.random(5, random_state=2).as_matrix()
    vectors = np.concatenate([[rotate(round_about, turn) for turn in turns], random_vectors(20), np.zeros((1, 36))])
    zonal = fit_linear_lobe(vectors)
    left = np.linalg.norm(zonal.harmonics() - vectors, axis=1)
    assert zonal.errors == pytest.approx(left, abs=1e-12) and left[:5].max() < 2e-3
    assert zonal.axes[:5, 0] == pytest.approx(turns[:, :, 2], abs=1e-3)
    assert (zonal.errors[5:-1] >= fitted(vectors[5:-1], 1).errors - 1e-9).all()


def test_a_joint_search_by_another_way_finds_nothing_better() -> None:
    """[Sloan05]'s own variables, axes and coefficients, with eq. 19 and 20's gradients left to differences."""
    vectors = random_vectors(3)
    zonal = fitted(vectors, 2)

    def error(x: np.ndarray, target: np.ndarray) -> float:
        axes = x[:6].reshape(1, 2, 3)
        axes = axes / np.linalg.norm(axes, axis=2)[:, :, None]
        coefficients = np.pad(x[6:].reshape(1, 2, 5), ((0, 0), (0, 0), (1, 0)))
        return float(((lobes(axes, coefficients)[0] - target)[1:] ** 2).sum())

    for i, target in enumerate(vectors):
        start = np.concatenate([zonal.axes[i].ravel(), zonal.coefficients[i, :, 1:].ravel()])
        assert error(start, target) == pytest.approx(zonal.errors[i] ** 2)
        assert minimize(error, start, (target,)).fun == pytest.approx(zonal.errors[i] ** 2, rel=1e-4)


def test_turning_the_lobes_turns_the_function() -> None:
    zonal, turn = fitted(random_vectors(4), 3), Rotation.from_euler("zyx", [0.3, 1.1, -2.0]).as_matrix()
    assert zonal.rotate(turn).harmonics() == pytest.approx(rotate(zonal.harmonics(), turn), abs=1e-12)
    each = np.stack([turn, np.eye(3), turn, np.eye(3)])
    assert zonal.rotate(each).harmonics()[1::2] == pytest.approx(zonal.harmonics()[1::2], abs=1e-15)


@pytest.mark.parametrize("n_lobes", [1, 3, 6])
@pytest.mark.parametrize("kept", [0, 1])
def test_nothing_and_constants_are_exact_about_any_axis(n_lobes: int, kept: int) -> None:
    vectors = np.zeros((2, 36))
    vectors[:, :kept] = 5.0
    zonal = fitted(vectors, n_lobes)
    assert (zonal.harmonics() == vectors).all() and (zonal.coefficients == 0.0).all() and (zonal.errors == 0.0).all()
    assert np.linalg.norm(zonal.axes, axis=2) == pytest.approx(1.0)


def test_more_lobes_than_there_are_keep_their_coefficients_bounded() -> None:
    """All the lobes want the one axis: their columns are the same, and the system singular but for its ridge."""
    axis = np.array([[[0.0, 0.6, 0.8]]])
    vectors = lobes(axis, np.linspace(1.0, 0.2, 6).reshape(1, 1, 6))
    zonal = fitted(vectors, MAX_LOBES)
    assert np.abs(zonal.coefficients).max() < 10.0 and zonal.errors[0] < 1e-3


@pytest.mark.parametrize("scale", [1e-30, 1e30])
def test_the_scale_changes_nothing_else(scale: float) -> None:
    vectors = random_vectors(3)
    zonal, scaled = fitted(vectors, 3), fitted(scale * vectors, 3)
    assert scaled.harmonics() / scale == pytest.approx(zonal.harmonics(), abs=1e-6)


def test_it_is_the_same_on_any_number_of_cores(monkeypatch: pytest.MonkeyPatch) -> None:
    vectors = random_vectors(7)
    monkeypatch.setattr(threads, "n_cores", lambda: 1)
    one = fitted(vectors, 3)
    monkeypatch.setattr(threads, "n_cores", lambda: 3)
    three = fitted(vectors, 3)
    assert (one.axes == three.axes).all() and (one.coefficients == three.coefficients).all()


def test_a_hand_waits_for_few_points_at_once() -> None:
    """A picture is drawn between two pieces: of points that are hard to fit so many take a tenth of a second."""
    vectors = np.random.default_rng(3).normal(size=(700, 9))
    shares = np.diff([0.0, *fit(vectors, 1, 0)])
    assert shares.max() * 700 <= 256 and shares.sum() == pytest.approx(1.0)


def test_odd_requests_are_refused() -> None:
    with pytest.raises(ValueError, match="7 lobes, expected 1 to 6"):
        fitted(random_vectors(1), 7)
    with pytest.raises(ValueError, match="expected finite ones"):
        fitted(np.full((1, 36), np.nan), 2)


def by_eq_23(alpha: float) -> list[float]:
    """g*_l of l < ORDER, as radiance of a white matt sheet."""
    found = []
    for l in range(ORDER):  # noqa: E741
        even = 2.0 * (1.0 + alpha) * (-1.0) ** (l // 2 - 1) / ((l + 2) * (l - 1)) if l != 1 else 0.0
        share = math.factorial(l) / (2.0**l * math.factorial(l // 2) ** 2)
        found.append(2.0 / 3.0 * (1.0 - alpha) if l == 1 else even * share if l % 2 == 0 else 0.0)
    return found


def projected_eq_22(alpha: float) -> np.ndarray:
    """The vector (ORDER^2,) of g(s) = s above and -alpha s below, over pi, by a quadrature of either half."""
    nodes, weights = np.polynomial.legendre.leggauss(ORDER)
    half, phi = (nodes + 1.0) / 2.0, (np.arange(2 * ORDER) + 0.5) * np.pi / ORDER
    total = np.zeros(ORDER * ORDER)
    for side, value in ((1.0, half), (-1.0, alpha * half)):
        sine = np.sqrt(1.0 - half**2)[:, None]
        ways = np.broadcast_arrays(sine * np.cos(phi), sine * np.sin(phi), side * half[:, None])
        each = basis(np.stack(ways, axis=-1).reshape(-1, 3), ORDER)
        total += (np.repeat(value * weights / 2.0, 2 * ORDER) * np.pi / ORDER) @ each
    return total / np.pi


@pytest.mark.parametrize("alpha", ALPHAS)
def test_the_lobe_is_eq_23_and_the_projection_of_eq_22(alpha: float) -> None:
    vector = membrane([alpha], ORDER).harmonics()[0]
    about_normal = basis([0.0, 0.0, 1.0], ORDER)
    by_band = np.repeat(by_eq_23(alpha), 2 * np.arange(ORDER) + 1) * about_normal
    assert vector == pytest.approx(by_band, abs=1e-12)
    assert vector == pytest.approx(projected_eq_22(alpha), abs=1e-6)


def test_translucency_is_a_share() -> None:
    with pytest.raises(ValueError, match="translucency, expected 0 to 1"):
        membrane([1.5], 3)
