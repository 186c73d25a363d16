"""A light probe's header, read before anything is loaded: its size, and by that its likely mapping.

Debevec's angular maps are square, lat-long maps are twice as wide as high; a user who drops a probe on the window
should not have to know. Where the guess is wrong, they can set it (`app.document.commands.light.SetMapping`).
"""

from __future__ import annotations

import os
import re
import struct
from pathlib import Path

from app.document.document import Mapping

HEADER_BYTES = 8192


def probe_size(file: Path) -> tuple[int, int] | None:
    """(width, height) of an OpenEXR or Radiance HDR image, by its header alone; None where that cannot be read."""
    if not os.path.isfile(file):
        return None
    try:
        with file.open("rb") as stream:
            head = stream.read(HEADER_BYTES)
    except OSError:
        return None
    window = re.search(rb"dataWindow\x00box2i\x00\x10\x00\x00\x00(.{16})", head, re.DOTALL)
    if window is not None:
        left, top, right, bottom = struct.unpack("<4i", window.group(1))
        return right - left + 1, bottom - top + 1
    size = re.search(rb"\n[-+]Y (\d{1,9}) [-+]X (\d{1,9})\n", head)
    return None if size is None else (int(size.group(2)), int(size.group(1)))


def likely_mapping(file: Path) -> Mapping:
    """ "angular" for a square probe, else "latlong"; also for what is no probe."""
    size = probe_size(file)
    return "angular" if size is not None and size[0] == size[1] else "latlong"
