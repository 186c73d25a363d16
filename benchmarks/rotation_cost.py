"""What it costs to rotate a transfer vector of order 3 to 9, and zonal lobes instead [Sloan05, 3.4].

`python -m benchmarks.rotation_cost` prints multiplications, beside the paper's, and nanoseconds on one core.
"""

from __future__ import annotations

import time
from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from app.measure.report import table
from app.system.kernel_cache import use_kernel_cache
from engine.sphere.harmonics import rotation_matrices

Float64Array = NDArray[np.float64]

# Multiplications by order, angles given [Sloan05, 3.4].
PAPERS = {3: 53, 4: 121, 5: 217, 6: 345, 7: 509, 8: 713, 9: 961}
N_LOBES = 4
N_POINTS, N_RUNS = 20_000, 5
QUARTER = ((1.0, 0.0, 0.0), (0.0, 0.0, 1.0), (0.0, -1.0, 0.0))  # about x, maps z to y


def multiplications(n: int) -> int:
    """Of a rotation of order n about z, x, z, x and z: 9 for band 1, which is a vector; in each band l beyond, three
    turns about z by l pairs of 4, and for each the sine and cosine of l times its angle from those before, by 2; and
    the quarter turns about x, of which l^2 + l + 1 numbers can differ from 0."""
    return 9 + sum(3 * (4 * l + 2) + 2 * (l * l + l + 1) for l in range(2, n))  # noqa: E741


def of_lobes(n_lobes: int) -> int:
    """Of as many lobes of any order: a matrix times each axis."""
    return 9 * n_lobes


def quarter_turns(n: int) -> tuple[NDArray[np.int64], NDArray[np.int64], Float64Array]:
    """Rows of the quarter turns about x of all bands below n, without what is 0: firsts, columns, values."""
    firsts, columns, values = [0], list[int](), list[float]()
    for l, matrix in enumerate(rotation_matrices(QUARTER, n)):  # noqa: E741
        for row in matrix:
            kept = np.flatnonzero(np.abs(row) > 1e-12)
            columns += (l * l + kept).tolist()
            values += row[kept].tolist()
            firsts.append(len(columns))
    return np.array(firsts), np.array(columns), np.array(values)


def angles_of(rotations: Float64Array) -> Float64Array:
    """Angles (P, 3) about z, y and z, the last applied first, of rotations (P, 3, 3)."""
    return Rotation.from_matrix(rotations).as_euler("ZYZ")


def rotate_all(vectors: Float64Array, rotations: Float64Array) -> Float64Array:
    """Vectors (P, n^2) of functions that are each rotated by its own rotation (P, 3, 3)."""
    from benchmarks._rotation_kernels import rotate_harmonics

    rotated = np.empty_like(vectors)
    rotate_harmonics(vectors, angles_of(rotations), *quarter_turns(round(vectors.shape[1] ** 0.5)), rotated)
    return rotated


def nanoseconds(n: int, n_points: int = N_POINTS, n_runs: int = N_RUNS) -> tuple[float, float]:
    """Of one rotation of a vector of order n, and of `N_LOBES` lobes: the quickest of some runs, on one core."""
    from benchmarks._rotation_kernels import rotate_axes, rotate_harmonics

    random = np.random.default_rng(1)
    vectors, axes = random.normal(size=(n_points, n * n)), random.normal(size=(n_points, N_LOBES, 3))
    rotations = Rotation.random(n_points, rng=1).as_matrix()
    angles, turns, rotated, turned = angles_of(rotations), quarter_turns(n), np.empty_like(vectors), np.empty_like(axes)
    return (
        _quickest(lambda: rotate_harmonics(vectors, angles, *turns, rotated), n_runs) / n_points,
        _quickest(lambda: rotate_axes(axes, rotations, turned), n_runs) / n_points,
    )


def _quickest(run: Callable[[], None], n_runs: int) -> float:
    """Nanoseconds of processor time; the first run compiles."""
    run()
    found = []
    for _ in range(n_runs):
        begun = time.thread_time_ns()
        run()
        found.append(time.thread_time_ns() - begun)
    return float(min(found))


def report() -> str:
    """The table by order."""
    lines = []
    for n, papers in PAPERS.items():
        of_vector, of_axes = nanoseconds(n)
        lines.append((n, papers, multiplications(n), of_lobes(N_LOBES), f"{of_vector:.0f}", f"{of_axes:.0f}"))
    lobes = f"{N_LOBES} lobes"
    return table(("n", "paper", "multiplications", f"of {lobes}", "ns a vector", f"ns {lobes}"), lines)


if __name__ == "__main__":
    use_kernel_cache()
    print(report())
