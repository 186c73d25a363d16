"""Damage to files, as accidents and attackers do it: drawn from a generator, so that a seed brings any of it back."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence

import numpy as np

Random = np.random.Generator
Damage = Callable[[bytearray, Random], None]

INTEGERS = (0, 1, 2, 127, 128, 255, 256, 32767, 32768, 65535, 2**24, 2**31 - 1, 2**31, 2**32 - 16, 2**32 - 1, 2**63)
NUMBERS = (
    b"0", b"-0.0", b"1", b"-1", b"2", b"255", b"256", b"65536", b"1e6", b"2147483647", b"-2147483648", b"4294967295",
    b"9223372036854775807", b"1e18", b"99999999999999999999", b"1e-320", b"1e30", b"1e308", b"-1e308", b"1e999", b"nan",
    b"-inf", b"0x7fffffff", b"1_0", b"0.1e", b"1.5", b"--1", b"", b"true", b'""', b"[]", b"{}",
)  # fmt: skip
NOISE = (b"\0", b"\xff", b"\n", b"\r\n", b" ", b"\t", b"#", b'"', b'"""', b"\\", b"[", b"]", b"{", b"}", b"=", b",",
         b".", b"/", b"-", b"\\u0000", b"~", b"\xef\xbb\xbf", b"\xc3\x28", b"\xe2\x80\xae")  # fmt: skip
MOST_DAMAGES = 6
GROWTH, ROOM = 4, 4096  # a damaged file is at most so many times as long, and so many bytes
_NUMBER = re.compile(rb"[-+]?\d[\d_]*(?:\.\d*)?(?:[eE][-+]?\d+)?")
_WORD = re.compile(rb"[A-Za-z_][A-Za-z_0-9]*|\"[^\"\n]*\"|[-+]?\d[\d.eE+-]*")


def damaged(data: bytes, others: Sequence[bytes], random: Random, is_text: bool) -> bytes:
    """The file after one damage or a few; parts may come from the others."""
    result, kinds = bytearray(data), TEXT if is_text else BINARY
    for _ in range(min(int(random.geometric(0.5)), MOST_DAMAGES)):
        if others and random.random() < 0.05:
            _splice(result, others[random.integers(len(others))], random)
        else:
            kinds[random.integers(len(kinds))](result, random)
        del result[GROWTH * len(data) + ROOM :]
    return bytes(result)


def _place(data: bytearray, random: Random) -> int:
    return int(random.integers(len(data) + 1))


def _block(data: bytearray, random: Random) -> slice:
    """Most are short, a few may be nearly all of it."""
    begin = _place(data, random)
    return slice(begin, begin + 1 + int(random.random() ** 4 * (len(data) - begin)))


def flip_a_bit(data: bytearray, random: Random) -> None:
    if data:
        data[random.integers(len(data))] ^= 1 << int(random.integers(8))


def set_a_byte(data: bytearray, random: Random) -> None:
    if data:
        data[random.integers(len(data))] = int(random.choice((0, 1, 127, 128, 255, int(random.integers(256)))))


def set_an_integer(data: bytearray, random: Random) -> None:
    """Of 2, 4 or 8 bytes, in either order, aligned or not: counts, lengths and offsets are such."""
    size = (2, 4, 8)[random.integers(3)]
    if len(data) < size:
        return
    at = int(random.integers(len(data) - size + 1))
    at -= at % size if random.random() < 0.5 else 0
    value = INTEGERS[random.integers(len(INTEGERS))] % 256**size
    data[at : at + size] = value.to_bytes(size, "little" if random.random() < 0.7 else "big")


def step_an_integer(data: bytearray, random: Random) -> None:
    """One more or less, or a few."""
    if len(data) >= 4:
        at = int(random.integers(len(data) - 3)) & ~3
        value = int.from_bytes(data[at : at + 4], "little") + int(random.integers(-16, 17))
        data[at : at + 4] = (value % 2**32).to_bytes(4, "little")


def set_a_number(data: bytearray, random: Random) -> None:
    """A float among others: none, infinite, or tiny."""
    if len(data) >= 4:
        at = int(random.integers(len(data) - 3)) & ~3
        values = (np.nan, np.inf, -np.inf, 3e38, -3e38, 1e-45, -0.0, 1e13)
        data[at : at + 4] = np.float32(values[random.integers(len(values))]).tobytes()


def cut(data: bytearray, random: Random) -> None:
    del data[_place(data, random) :]


def drop(data: bytearray, random: Random) -> None:
    del data[_block(data, random)]


def blank(data: bytearray, random: Random) -> None:
    block = _block(data, random)
    data[block] = bytes([(0, 255, 32)[random.integers(3)]]) * len(data[block])


def repeat(data: bytearray, random: Random) -> None:
    block = _block(data, random)
    part = bytes(data[block])
    data[block.stop : block.stop] = part * min(1 + int(random.geometric(0.3)), max(1, 65536 // max(len(part), 1)))


def move(data: bytearray, random: Random) -> None:
    block = _block(data, random)
    part = bytes(data[block])
    if random.random() < 0.5:
        del data[block]
    at = _place(data, random)
    data[at:at] = part


def add_noise(data: bytearray, random: Random) -> None:
    at = _place(data, random)
    data[at:at] = random.bytes(int(random.integers(1, 16)))


def add_a_sign(data: bytearray, random: Random) -> None:
    at = _place(data, random)
    data[at:at] = NOISE[random.integers(len(NOISE))] * int(random.choice((1, 1, 1, 2, 300)))


def another_number(data: bytearray, random: Random) -> None:
    _replace_one(data, _NUMBER, NUMBERS[random.integers(len(NUMBERS))], random)


def another_word(data: bytearray, random: Random) -> None:
    words = _WORD.findall(data)
    if words:
        _replace_one(data, _WORD, words[random.integers(len(words))], random)


def _replace_one(data: bytearray, pattern: re.Pattern[bytes], new: bytes, random: Random) -> None:
    places = [found.span() for found in pattern.finditer(data)]
    if places:
        begin, end = places[random.integers(len(places))]
        data[begin:end] = new


def shuffle_lines(data: bytearray, random: Random) -> None:
    """Drop, repeat or move a line."""
    lines = bytes(data).splitlines(keepends=True)
    if lines:
        taken = lines.pop(int(random.integers(len(lines))))
        for _ in range(int(random.integers(4))):
            lines.insert(int(random.integers(len(lines) + 1)), taken)
        data[:] = b"".join(lines)


def _splice(data: bytearray, other: bytes, random: Random) -> None:
    """Its beginning, and the end of another file."""
    at = _place(data, random)
    data[at:] = other[int(random.integers(len(other) + 1)) if random.random() < 0.5 else min(at, len(other)) :]


ANY: tuple[Damage, ...] = (flip_a_bit, set_a_byte, cut, drop, blank, repeat, move, add_noise)
BINARY: tuple[Damage, ...] = (*ANY, flip_a_bit, set_an_integer, set_an_integer, step_an_integer, set_a_number,
                              another_number, another_word)  # fmt: skip
TEXT: tuple[Damage, ...] = (*ANY, add_a_sign, another_number, another_number, another_number, another_word,
                            another_word, shuffle_lines, shuffle_lines)  # fmt: skip
