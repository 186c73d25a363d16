"""Encoders of EXT_meshopt_compression and KHR_meshopt_compression, by the text of the extension, as obvious as can be.

Where the format leaves a choice (widths of groups, controls, edges, tables) a random one is made, so that a decoder
sees all of them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

Random = np.random.Generator
Bytes = np.ndarray


def zigzag(value: int, bits: int) -> int:
    """0, 1, 2, 3 … for 0, −1, 1, −2 …, of a difference that wraps around."""
    value = (value + (1 << bits - 1)) % (1 << bits) - (1 << bits - 1)
    return 2 * value if value >= 0 else -2 * value - 1


def rotated_left(value: int, turn: int) -> int:
    return (value << turn | value >> 32 - turn) & 0xFFFFFFFF


def packed_group(values: Sequence[int], bits: int) -> bytes:
    """16 deltas of so many bits; what does not fit follows as a byte."""
    if bits == 0:
        return b""
    if bits == 8:
        return bytes(values)
    sentinel, n_in_byte = 2**bits - 1, 8 // bits
    small = [min(value, sentinel) for value in values]
    packed = bytearray()
    for first in range(0, 16, n_in_byte):
        part = small[first : first + n_in_byte]
        if bits > 1:  # the first delta in the highest bits; of single bits, in the lowest
            part = part[::-1]
        packed.append(sum(value << bits * place for place, value in enumerate(part)))
    return bytes(packed) + bytes(value for value in values if value >= sentinel)


def encode_vertices(elements: Bytes, version: int, random: Random) -> bytes:
    """A stream of elements (N, stride) of bytes."""
    n, stride = elements.shape
    baseline = random.integers(0, 256, stride, np.uint8)
    modes = [int(random.integers(3)) for _ in range(stride // 4)] if version else [0] * (stride // 4)
    turns = [int(random.integers(16)) if mode == 2 else 0 for mode in modes]
    before = np.concatenate([baseline[None], elements[:-1]]).astype(int)
    now = elements.astype(int)
    deltas = np.zeros((n, stride), int)
    for channel, (mode, turn) in enumerate(zip(modes, turns, strict=True)):
        size = {0: 1, 1: 2, 2: 4}[mode]
        for k in range(4 * channel, 4 * channel + 4, size):
            weights = 256 ** np.arange(size)
            for i in range(n):
                old, new = int(before[i, k : k + size] @ weights), int(now[i, k : k + size] @ weights)
                code = rotated_left(old ^ new, turn) if mode == 2 else zigzag(new - old, 8 * size)
                deltas[i, k : k + size] = [code >> 8 * j & 255 for j in range(size)]
    stream = bytearray([0xA0 | version])
    most = min(8192 // stride // 16 * 16, 256)
    for first in range(0, n, most):
        block = deltas[first : first + most]
        controls, body = [], bytearray()
        for k in range(stride):
            groups = np.zeros(-(-len(block) // 16) * 16, int)
            groups[: len(block)] = block[:, k]
            if version:
                choices = [0, 1, 3] + [2] * (not block[:, k].any())
                controls.append(int(random.choice(choices)))
                if controls[-1] == 2:
                    continue
                if controls[-1] == 3:
                    body += bytes(block[:, k].tolist())
                    continue
            widths = [(0, 1, 2, 4), (1, 2, 4, 8)][controls[-1]] if version else (0, 2, 4, 8)
            headers, packed = [], bytearray()
            for group in groups.reshape(-1, 16):
                fitting = [code for code, bits in enumerate(widths) if bits or not group.any()]
                headers.append(int(random.choice(fitting)))
                packed += packed_group(group.tolist(), widths[headers[-1]])
            headers += [0] * (-len(headers) % 4)
            body += bytes(
                sum(code << 2 * j for j, code in enumerate(headers[i : i + 4])) for i in range(0, len(headers), 4)
            )
            body += packed
        if version:
            stream += bytes(
                sum(code << 2 * j for j, code in enumerate(controls[i : i + 4])) for i in range(0, stride, 4)
            )
        stream += body
    tail = baseline.tobytes()
    if version:
        tail += bytes(mode | turn << 4 for mode, turn in zip(modes, turns, strict=True))
    return bytes(stream) + b"\0" * max((24 if version else 32) - len(tail), 0) + tail


def number(value: int) -> bytes:
    """Seven bits a byte, the lowest first."""
    found = bytearray()
    while value >= 128:
        found.append(value & 127 | 128)
        value >>= 7
    return bytes([*found, value])


def encode_triangles(indices: Sequence[int], random: Random) -> bytes:
    """A stream of the triangles of indices (3 T)."""
    table = [0x00, *(int(a) << 4 | int(b) for a, b in random.integers(0, 15, (13, 2))), 0, 0]
    edges: list[tuple[int, int]] = []
    vertices: list[int] = []
    codes, data, following, last = bytearray(), bytearray(), 0, 0

    def given(value: int) -> bytes:
        nonlocal last
        code = zigzag(value - last, 32)
        last = value
        return number(code)

    def place(value: int, most: int) -> int | None:
        there = vertices[:most]
        return there.index(value) if value in there else None

    for a, b, c in np.reshape(indices, (-1, 3)).tolist():
        if (a, b) in edges[:15] and random.random() < 0.9:
            code, known = edges[:15].index((a, b)) << 4, place(c, 13)
            if c == following:
                following += 1
                vertices.insert(0, c)
            elif known:
                code |= known
            else:
                step = {last - 1: 13, last + 1: 14}.get(c, 15)
                code |= step
                if step == 15:
                    data += given(c)
                last = c
                vertices.insert(0, c)
            codes.append(code)
            edges[:0] = [(a, c), (c, b)]
        else:
            restarts = (a, b, c) == (0, 1, 2) and random.random() < 0.5
            start = 0 if restarts else following
            after, pair, ends = start + (a == start), 0, []
            for value in (b, c):
                known = place(value, 14)
                if value == after:
                    code, after = 0, after + 1
                elif known is not None:
                    code = known + 1
                else:
                    code = 15
                pair = pair << 4 | code
                ends.append(code)
            if pair == 0 and a != start:  # a pair of 0 would restart: give both corners instead
                after, ends, pair = start, [15, 15], 0xFF
            if a == start and pair in table[:14] and not restarts and 15 not in ends:
                codes.append(0xF0 | table.index(pair))
            else:
                codes.append(0xFE if a == start else 0xFF)
                data.append(pair)
                if a != start:
                    data += given(a)
                for value, code in zip((b, c), ends, strict=True):
                    if code == 15:
                        data += given(value)
            following = after
            vertices.insert(0, a)
            for value, code in zip((b, c), ends, strict=True):
                if code in (0, 15):
                    vertices.insert(0, value)
            edges[:0] = [(a, c), (c, b), (b, a)]
        del edges[16:], vertices[16:]
    return b"\xe1" + bytes(codes) + bytes(data) + bytes(table)


def encode_indices(indices: Sequence[int], random: Random) -> bytes:
    """A stream of indices that need not be triangles."""
    last, data = [0, 0], bytearray()
    for value in indices:
        baseline = int(random.integers(2))
        data += number(zigzag(value - last[baseline], 31) << 1 | baseline)
        last[baseline] = value
    return b"\xd1" + bytes(data) + b"\0" * 4
