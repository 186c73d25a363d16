"""Telling a light probe's mapping by the file's header, before anything is loaded.

Debevec's angular maps are square, lat-long maps are twice as wide as high; a person who drops a probe on the window
should not have to know.
"""

from __future__ import annotations

import re
import struct
from pathlib import Path

HEADER_BYTES = 8192


def looks_angular(file: Path) -> bool:
    """Whether a light probe is square, as angular maps are, by its header alone; False where that cannot be told."""
    if not file.is_file():
        return False
    try:
        with file.open("rb") as stream:
            head = stream.read(HEADER_BYTES)
    except OSError:
        return False
    window = re.search(rb"dataWindow\x00box2i\x00\x10\x00\x00\x00(.{16})", head, re.DOTALL)
    if window is not None:
        left, top, right, bottom = struct.unpack("<4i", window.group(1))
        return bool(right - left == bottom - top)
    size = re.search(rb"\n[-+]Y (\d+) [-+]X (\d+)\n", head)
    return size is not None and size.group(1) == size.group(2)
