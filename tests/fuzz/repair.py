"""Lengths and checksums made right again in a damaged file, so that what is behind them is looked at too."""

from __future__ import annotations

import re
import struct
import zlib

_FIXED = struct.Struct("<8sIIQI")  # see app.worker.array_files
_ROW = re.compile(rb'\["[^"]*", "[<>|]([biufc])(\d+)", \[([\d, ]*)\], (\d+), "([0-9a-f]{8})"\]')


def repaired_png(data: bytes) -> bytes:
    """With the checksum of each chunk whose length fits."""
    result, at = bytearray(data), 8
    while at + 12 <= len(result):
        end = at + 8 + int.from_bytes(result[at : at + 4], "big")
        if end + 4 > len(result):
            break
        result[end : end + 4] = zlib.crc32(result[at + 4 : end]).to_bytes(4, "big")
        at = end + 4
    return bytes(result)


def repaired_glb(data: bytes) -> bytes:
    """With the lengths of the file, of its JSON and of its binary chunk."""
    if len(data) < 20:
        return data
    mark = data.find(b"BIN\0", 20)
    text, binary = (data[20:], b"") if mark < 0 else (data[20 : mark - 4], data[mark + 4 :])
    text += b" " * (-len(text) % 4)
    chunks = struct.pack("<I4s", len(text), b"JSON") + text
    if mark >= 0:
        chunks += struct.pack("<I4s", len(binary), b"BIN\0") + binary
    return struct.pack("<4sII", b"glTF", 2, 12 + len(chunks)) + chunks


def repaired_records(data: bytes) -> bytes:
    """With the sizes and checksums that each of the cache's records should have: forged, not damaged."""
    marks = [found.start() for found in re.finditer(b"INSITUA1", data)]
    if not marks:
        return data
    parts = [data[begin:end] for begin, end in zip(marks, [*marks[1:], len(data)], strict=True)]
    return data[: marks[0]] + b"".join(map(_repaired_record, parts))


def _repaired_record(record: bytes) -> bytes:
    text_end = record.find(b"]]}", _FIXED.size) + 3
    if text_end < 3:
        return record
    text, start = record[_FIXED.size : text_end], -(-text_end // 64) * 64

    def checked(row: re.Match[bytes]) -> bytes:
        size = int(row[2])
        for side in re.findall(rb"\d+", row[3]):
            size *= int(side)
        begin = start + int(row[4])
        return row[0].replace(row[5], b"%08x" % zlib.crc32(record[begin : begin + size]))

    text = _ROW.sub(checked, text)
    numbers = (b"INSITUA1", 1, len(text), len(record))
    crc = zlib.crc32(text, zlib.crc32(_FIXED.pack(*numbers, 0)))
    return _FIXED.pack(*numbers, crc) + text + record[text_end:]
