"""The decoder of meshopt streams, against an encoder that makes random choices, and against published streams."""

from __future__ import annotations

import numpy as np
import pytest

from engine.scene.loaders.meshopt import CodecError, decode_meshopt
from tests.naive.meshopt_encoder import encode_indices, encode_triangles, encode_vertices


def decoded(stream: bytes, count: int, stride: int, mode: str = "ATTRIBUTES", filtering: str = "NONE") -> np.ndarray:
    return decode_meshopt(np.frombuffer(stream, np.uint8), count, stride, mode, filtering)


@pytest.mark.parametrize("version", [0, 1])
@pytest.mark.parametrize(("n", "stride"), [(1, 4), (16, 4), (17, 12), (300, 8), (700, 16), (40, 256)])
def test_vertices_survive_encoding(version: int, n: int, stride: int) -> None:
    random = np.random.default_rng([version, n, stride])
    smooth = np.cumsum(random.integers(-3, 4, (n, stride)), axis=0)
    smooth[:, : stride // 2] *= random.integers(0, 2)  # channels that stay the same
    elements = np.where(random.random((n, 1)) < 0.1, random.integers(0, 256, (n, stride)), smooth).astype(np.uint8)
    stream = encode_vertices(elements, version, random)
    assert decoded(stream, n, stride).tolist() == elements.reshape(-1).tolist()


def grid(n: int) -> list[int]:
    """Triangles of a grid of n x n squares, in rows."""
    corners = [(y * (n + 1) + x, y * (n + 1) + x + 1, (y + 1) * (n + 1) + x) for y in range(n) for x in range(n)]
    return [i for a, b, c in corners for i in (a, b, c, c, b, c + 1)]


@pytest.mark.parametrize("stride", [2, 4])
@pytest.mark.parametrize("seed", range(4))
def test_triangles_survive_encoding(stride: int, seed: int) -> None:
    random = np.random.default_rng(seed)
    indices = grid(9) + [0, 1, 2] + random.integers(0, 60_000, 90).tolist() + grid(3)
    stream = encode_triangles(indices, random)
    found = decoded(stream, len(indices), stride, "TRIANGLES").view(f"<u{stride}")
    assert found.tolist() == indices


@pytest.mark.parametrize("stride", [2, 4])
def test_indices_survive_encoding(stride: int) -> None:
    random = np.random.default_rng(stride)
    indices = random.integers(0, 2 ** (16 if stride == 2 else 29), 500).tolist()
    found = decoded(encode_indices(indices, random), 500, stride, "INDICES").view(f"<u{stride}")
    assert found.tolist() == indices


# Streams and their contents from the tests of meshoptimizer (MIT, Arseny Kapoulkine), which define the format.
VERTICES = np.array([0, 0, 0, 0, 0, 0, 300, 0, 0, 0, 500, 0, 0, 300, 0, 0, 0, 500, 300, 300, 0, 0, 500, 500], "<u2")
TABLE = "0076875667 78a9866589689801690000"
WAVE = np.r_[0:8, 8:0:-1]
PUBLISHED = {
    "version 0": (
        "a0 013f000000585758 0126000000 010c00000058 0108" + "00" * 7 +
        "013f000000171817 0126000000 010c00000017 0108" + "00" * 35,
        4, 12, "ATTRIBUTES", VERTICES,
    ),
    "version 1": (
        "a1 eeaaee 004b4b4b 00004b00 007d7d7d 00007d00" + "00" * 21 + "620062", 4, 12, "ATTRIBUTES", VERTICES
    ),
    "pairs of bytes": (
        "a1 9999 012aaaaaaa 020444444443333333 020666666666666666 020888888887777777" + "00" * 14
        + "f800f800f000f000 0101",
        16, 8, "ATTRIBUTES",
        np.stack([np.arange(248, 264), 248 + 2 * WAVE, 240 + 3 * np.arange(16), 240 + 4 * WAVE], axis=1).astype("<u2"),
    ),
    "exclusive or": (
        "a1 ababfaff 00020202 00a5c23a 00abf957 00954285 00ddca6d 00ac1a50 005c99fe 004d0c39"
        "00000000 00000000 70000000 0080070c 22263b86 00001200",
        4, 16, "ATTRIBUTES",
        np.array([0, 112, 201818112, 2252023330, 1, 29, 1188167680, 1600748723, 2, 126, 1739489280, 1696368920, 3, 155,
                  621084672, 1218163169], "<u4"),
    ),
    "triangles": (
        "e1 f010fe1f3d 000a" + TABLE, 15, 4, "TRIANGLES",
        np.array([0, 1, 2, 2, 1, 3, 0, 1, 2, 2, 1, 5, 2, 1, 4], "<u4"),
    ),
    "triangles of other parts": (
        "e1 f010feff f00cff020202" + TABLE, 12, 4, "TRIANGLES",
        np.array([0, 1, 2, 2, 1, 3, 4, 6, 5, 7, 8, 9], "<u4"),
    ),
    "edges": ("e1 f0203040" + TABLE, 12, 4, "TRIANGLES", np.array([0, 1, 2, 1, 0, 3, 2, 1, 4, 0, 2, 5], "<u4")),
    "indices": ("d1 0004cd010407981f 00000000", 6, 4, "INDICES", np.array([0, 1, 51, 2, 49, 1000], "<u4")),
}  # fmt: skip


@pytest.mark.parametrize("name", PUBLISHED)
def test_published_streams(name: str) -> None:
    stream, count, stride, mode, expected = PUBLISHED[name]
    found = decoded(bytes.fromhex(stream), count, stride, mode)
    assert found.tolist() == expected.reshape(-1).view(np.uint8).tolist()


FILTERED = {
    "octahedral, 8 bits": (
        "a0 01070000001e 013f0000008b8cfd 00 0126000000" + "00" * 28 + "00017f00", 4, 4, "OCTAHEDRAL",
        np.array([0, 1, 127, 0, 0, -97, 82, 1, -1, 1, 127, 0, 1, -126, -15, 1], "i1"),
    ),
    "exponential": (
        "a0" + "00" * 36 + "030000ff f7ffff02 ffff7ffe", 1, 16, "EXPONENTIAL",
        np.array([0, 0x3FC00000, 0xC2100000, 0x49FFFFFE], "<u4"),
    ),
    "colour, 8 bits": (
        "a0013f0000007e7d4c013f000000fdfdfe013f000000838280013f0000007d3f7e" + "00" * 28 + "407fc1ff", 4, 4, "COLOR",
        np.array([254, 1, 0, 255, 0, 254, 0, 128, 1, 0, 255, 64, 102, 102, 102, 191], "u1"),
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", FILTERED)
def test_published_filters(name: str) -> None:
    stream, count, stride, filtering, expected = FILTERED[name]
    found = decoded(bytes.fromhex(stream), count, stride, filtering=filtering).view(expected.dtype)
    # results may differ by one unit, except of exponents
    assert np.abs(found.astype(np.int64) - expected.astype(np.int64)).max() <= (filtering != "EXPONENTIAL")


@pytest.mark.parametrize("bits", [8, 16])
def test_octahedral_vectors_and_quaternions_are_unit(bits: int) -> None:
    random = np.random.default_rng(bits)
    n = random.normal(size=(200, 3))
    n /= np.linalg.norm(n, axis=1, keepdims=True)
    most = 2 ** (bits - 1) - 1
    flat = n / np.abs(n).sum(axis=1, keepdims=True)
    x, y = flat[:, 0], flat[:, 1]
    folded = n[:, 2] < 0  # the lower half is folded outwards over the diagonals
    x, y = (np.where(folded, np.copysign(1 - np.abs(b), a), a) for a, b in ((x, y), (y, x)))
    codes = np.rint(np.stack([x, y, np.ones(200), np.zeros(200)], axis=1) * most).astype(f"<i{bits // 8}")
    stream = encode_vertices(codes.view(np.uint8).reshape(200, -1), 1, random)
    found = decoded(stream, 200, bits // 2, filtering="OCTAHEDRAL").view(codes.dtype).reshape(-1, 4)[:, :3] / most
    assert np.abs(found - n).max() < 4.0 / most
    if bits == 16:
        q = random.normal(size=(200, 4))
        q /= np.linalg.norm(q, axis=1, keepdims=True)
        rows, largest = np.arange(200), np.abs(q).argmax(axis=1)
        q *= np.sign(q[rows, largest])[:, None]
        smaller = np.stack([q[rows, (largest + k) % 4] for k in (1, 2, 3)], axis=1) * np.sqrt(2.0)
        codes = np.concatenate([np.rint(smaller * 2047), ((2047 & ~3) | largest)[:, None]], axis=1).astype("<i2")
        stream = encode_vertices(codes.view(np.uint8).reshape(200, 8), 0, random)
        found = decoded(stream, 200, 8, filtering="QUATERNION").view("<i2").reshape(-1, 4) / 32767.0
        assert np.abs(found - q).max() < 1e-3  # of 12 bits


def test_damaged_streams_are_refused_or_decoded() -> None:
    """Neither more is read than there is, nor does anything but a `CodecError` come out."""
    random = np.random.default_rng(5)
    elements = np.cumsum(random.integers(-2, 3, (70, 8)), axis=0).astype(np.uint8)
    streams = [
        *((encode_vertices(elements, version, random), 70, 8, "ATTRIBUTES") for version in (0, 1)),
        (encode_triangles(grid(5), random), 150, 4, "TRIANGLES"),
        (encode_indices(range(60), random), 60, 2, "INDICES"),
    ]
    refused = 0
    for stream, count, stride, mode in streams:
        for _ in range(300):
            damaged = bytearray(stream[: random.integers(1, len(stream) + 1)])
            for k in random.integers(0, len(damaged), 3):
                damaged[k] ^= 1 << int(random.integers(8))
            try:
                assert len(decoded(bytes(damaged), count, stride, mode)) == count * stride
            except CodecError:
                refused += 1
    assert refused > 600


@pytest.mark.parametrize(
    ("count", "stride", "mode", "filtering", "said"),
    [
        (4, 6, "ATTRIBUTES", "NONE", "byteStride"),
        (4, 4, "ATTRIBUTES", "QUATERNION", "byteStride"),
        (4, 12, "ATTRIBUTES", "COLOR", "byteStride"),
        (4, 4, "ATTRIBUTES", "FOURIER", "filter"),
        (3, 4, "TRIANGLES", "COLOR", "filter"),
        (4, 4, "TRIANGLES", "NONE", "count"),
        (3, 8, "TRIANGLES", "NONE", "byteStride"),
        (3, 4, "POINTS", "NONE", "mode"),
        (3, 4, "INDICES", "NONE", "first byte"),
    ],
)
def test_properties_that_do_not_fit(count: int, stride: int, mode: str, filtering: str, said: str) -> None:
    stream = b"\xe1" if mode == "TRIANGLES" else b"\xa0"
    with pytest.raises(CodecError, match=said):
        decoded(stream + b"\0" * 60, count, stride, mode, filtering)
