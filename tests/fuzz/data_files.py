"""Small sound files of measured BRDFs and of the cache, and their readers."""

from __future__ import annotations

from pathlib import Path

import numpy as np


def merls(_: Path) -> list[bytes]:
    from engine.measured.sample_files import merl_bytes
    from tests.naive.measured import analytic_samples

    return [merl_bytes(analytic_samples(gaps=0.1))]


def read_merl_file(path: Path) -> None:
    from engine.measured.sample_files import merl_samples, read_merl

    assert np.isfinite(merl_samples(read_merl(path), path)).all()


def cornells(_: Path) -> list[bytes]:
    random = np.random.default_rng(3)
    rows = [[*random.uniform(0.0, 1.5, 4), *random.uniform(0.0, 1.0, 4)] for _ in range(60)]
    lines = ["# a seed", "4", "450 500 600 650", *(" ".join(f"{value:.4f}" for value in row) for row in rows)]
    return ["\n".join(lines).encode()]


def read_cornell_file(path: Path) -> None:
    from engine.measured.sample_files import read_cornell, scattered_samples

    found = scattered_samples(read_cornell(path), path)
    assert np.isfinite(found.values).all() and np.isfinite(found.wi).all() and np.isfinite(found.wo).all()


def tensors(_: Path) -> list[bytes]:
    from tests.naive.tensor_files import Gloss, acquired, tensor_bytes

    bands = np.array([420.0, 500.0, 580.0, 660.0])
    colours = Gloss(ground=(0.1, 0.2, 0.3, 0.4), shine=(0.5, 0.5, 0.4, 0.4))
    few = {"n_theta": 2, "n": 3, "n_facets": 4}
    return [
        tensor_bytes(acquired(Gloss(), **few)),
        tensor_bytes(acquired(Gloss(0.5, 0.2), n_phi=3, turn=np.pi, **few)),
        tensor_bytes(acquired(colours, wavelengths=bands, **few)),
    ]


def read_tensors(path: Path) -> None:
    from engine.measured.tensor_files import adaptive_reflection, read_tensor_file

    v = np.random.default_rng(4).normal(size=(2, 50, 3))
    wi, wo = np.abs(v / np.linalg.norm(v, axis=2, keepdims=True))
    assert np.isfinite(adaptive_reflection(read_tensor_file(path), path).evaluate(wi, wo)).all()


def entries(folder: Path) -> list[bytes]:
    """Of visibility, of a store of bands, and of fitted lobes."""
    from engine.realtime.triple_product.visibility import deflate_bits
    from engine.realtime.zonal_harmonics.zonal import membrane
    from tests.engine.precompute.direct.test_bandstore import sparse_bands, store_of, whole

    bits = np.random.default_rng(1).integers(0, 256, (9, 40)).astype(np.uint8)
    fitted = membrane(np.full(5, 0.5), 6)
    kinds = (
        deflate_bits("bits", bits),
        whole(store_of(sparse_bands(7, 8, 4, seed=2))),
        {name: getattr(fitted, name).astype(np.float32) for name in ("low", "axes", "coefficients", "errors")},
    )
    return [_kept(folder / "cache", arrays) for arrays in kinds]


def _kept(folder: Path, arrays: dict[str, np.ndarray]) -> bytes:
    from app.worker.cache import ArrayCache

    ArrayCache(folder).put("k", arrays)
    return (folder / "k.arrays").read_bytes()


def read_entry(path: Path) -> None:
    """By all who take such; none of them raises."""
    from app.worker.cache import ArrayCache
    from app.worker.deform_worker import stored_lobes
    from engine.core.stored_arrays import ArrayReader
    from engine.precompute.direct.bandstore import arrays_of_file, store_from_arrays
    from engine.realtime.triple_product.visibility import inflate_bits

    data = path.read_bytes()
    for read in (
        lambda arrays: inflate_bits("bits", ArrayReader(arrays), 9, 40),
        lambda arrays: store_from_arrays((8, 4), arrays_of_file((8, 4), 7, arrays)).radiance(
            np.ones((8, 3)), np.ones((4, 3))
        ),
        lambda arrays: stored_lobes(arrays, 5).harmonics(),
    ):
        ArrayCache(path.parent).get(path.stem, read)
        if not path.exists():  # one that is damaged is taken away
            path.write_bytes(data)


def tiles(folder: Path) -> list[bytes]:
    from app.worker.cache import ArrayCache

    with ArrayCache(folder / "tiles").open_tiles("k", 3) as kept:
        for i in range(3):
            kept.append_tile(i, {"a": np.full((4, 3), i, np.float32), "b": np.arange(5)})
    return [(folder / "tiles" / "k.tiles").read_bytes()]


def read_tiles(path: Path) -> None:
    from app.worker.cache import ArrayCache

    with ArrayCache(path.parent).open_tiles(path.stem, 3) as kept:
        for i in kept.complete_tiles:
            kept.tile(i, dict)
