"""What is kept of a function's arrays, by their size."""

import numpy as np
import pytest

from engine.core.array_cache import cache_recent_arrays
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.precompute.indirect.albedo import albedo_bands


def test_the_oldest_are_forgotten_by_their_size() -> None:
    asked = []

    @cache_recent_arrays(1000)
    def zeros(n: int, name: str = "") -> np.ndarray:
        asked.append((n, name))
        return np.zeros(n, np.uint8)

    for n in (400, 400, 500, 400, 300, 400, 500):
        assert len(zeros(n)) == n
    # 400 and 500 fit; 300 is one too many, and 500, not asked for since, goes.
    assert asked == [(400, ""), (500, ""), (300, ""), (500, "")]
    assert zeros(5000) is zeros(5000)  # the last one is kept in any case
    assert zeros(5, name="a") is not zeros(5)
    with pytest.raises(ValueError, match="read-only"):
        zeros(5)[0] = 1


def test_albedos_of_every_roughness_stay_within_bounds() -> None:
    import tracemalloc

    def ask(alpha: float) -> np.ndarray:
        layer = make_layer(MODELS["rough_conductor"], {"alpha": alpha})
        return albedo_bands("rough_conductor", tuple(layer.quotient_parameters().tolist()), (64, 32))

    first = ask(0.2)
    assert ask(0.2) is first
    tracemalloc.start()
    try:
        before = tracemalloc.get_traced_memory()[0]
        n_bytes = sum(ask(0.2 + 0.005 * i).nbytes for i in range(30))
        grown = tracemalloc.get_traced_memory()[0] - before
    finally:
        tracemalloc.stop()
    assert n_bytes > 15e6 and grown < 10e6
