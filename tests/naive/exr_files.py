"""OpenEXR files written in the plainest way, uncompressed: what the library for Python cannot write [Kainz13].

Several parts, levels of mip maps, subsampled channels and channels of different types. One scan line is one chunk.
"""

import struct
from dataclasses import dataclass, field

import numpy as np

MAGIC, VERSION, TILED, MULTI_PART = 0x01312F76, 2, 0x200, 0x1000
TYPES = {"uint32": 0, "float16": 1, "float32": 2}

Attributes = dict[str, tuple[str, bytes]]


@dataclass
class ExrPart:
    """channels: planes (h, w) by name, of every sampling[name] = (x, y)-th pixel. corner: the first column and row of
    the data window. display: the display window's first and last column and row. tile: the side of tiles, 0 for scan
    lines. is_mip_map: with all levels, each every second row and column of the finer one."""

    channels: dict[str, np.ndarray]
    sampling: dict[str, tuple[int, int]] = field(default_factory=dict)
    corner: tuple[int, int] = (0, 0)
    display: tuple[int, int, int, int] | None = None
    tile: int = 0
    is_mip_map: bool = False
    name: str = ""
    attributes: Attributes = field(default_factory=dict)

    @property
    def size(self) -> tuple[int, int]:
        """Width and height of the data window."""
        name, plane = next(iter(self.channels.items()))
        x, y = self.sampling.get(name, (1, 1))
        return plane.shape[1] * x, plane.shape[0] * y

    def chunks(self) -> list[bytes]:
        return self._tiles() if self.tile else self._scan_lines()

    def _scan_lines(self) -> list[bytes]:
        chunks = []
        for y in range(self.corner[1], self.corner[1] + self.size[1]):
            line = b""
            for name in sorted(self.channels):
                step = self.sampling.get(name, (1, 1))[1]
                if y % step == 0:
                    line += self.channels[name][(y - self.corner[1]) // step].tobytes()
            chunks.append(struct.pack("<2i", y, len(line)) + line)
        return chunks

    def _tiles(self) -> list[bytes]:
        chunks = []
        for level in range(max(self.size).bit_length() if self.is_mip_map else 1):
            width, height = (max(1, side >> level) for side in self.size)
            planes = [self.channels[name][:: 2**level, :: 2**level][:height, :width] for name in sorted(self.channels)]
            for row in range(0, height, self.tile):
                for column in range(0, width, self.tile):
                    rows, columns = range(row, min(row + self.tile, height)), slice(column, column + self.tile)
                    pixels = b"".join(plane[y, columns].tobytes() for y in rows for plane in planes)
                    place = struct.pack("<4i", column // self.tile, row // self.tile, level, level)
                    chunks.append(place + struct.pack("<i", len(pixels)) + pixels)
        return chunks

    def header(self, n_chunks: int, is_one_of_several: bool) -> bytes:
        width, height = self.size
        left, top = self.corner
        window = (left, top, left + width - 1, top + height - 1)
        listed = b""
        for name in sorted(self.channels):
            kind, sampling = TYPES[self.channels[name].dtype.name], self.sampling.get(name, (1, 1))
            listed += name.encode() + b"\0" + struct.pack("<4i", kind, 0, *sampling)
        own: Attributes = {
            "channels": ("chlist", listed + b"\0"),
            "compression": ("compression", b"\0"),
            "dataWindow": ("box2i", struct.pack("<4i", *window)),
            "displayWindow": ("box2i", struct.pack("<4i", *(self.display or window))),
            "lineOrder": ("lineOrder", b"\0"),
            "pixelAspectRatio": ("float", struct.pack("<f", 1.0)),
            "screenWindowCenter": ("v2f", bytes(8)),
            "screenWindowWidth": ("float", struct.pack("<f", 1.0)),
        }
        if self.tile:
            own["tiles"] = ("tiledesc", struct.pack("<2IB", self.tile, self.tile, int(self.is_mip_map)))
        if is_one_of_several:
            own["name"] = ("string", self.name.encode())
            own["type"] = ("string", b"tiledimage" if self.tile else b"scanlineimage")
            own["chunkCount"] = ("int", struct.pack("<i", n_chunks))
        return b"".join(
            name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(value)) + value
            for name, (kind, value) in sorted((own | self.attributes).items())
        ) + b"\0"  # fmt: skip


def exr_file(*parts: ExrPart) -> bytes:
    """The bytes of a file with these parts."""
    several = len(parts) > 1
    chunks = [part.chunks() for part in parts]
    flags = MULTI_PART if several else TILED if parts[0].tile else 0
    data = struct.pack("<2i", MAGIC, VERSION | flags)
    for part, own in zip(parts, chunks, strict=True):
        data += part.header(len(own), several)
    data += b"\0" if several else b""
    place = len(data) + 8 * sum(len(own) for own in chunks)
    offsets, pixels = b"", b""
    for number, own in enumerate(chunks):
        for chunk in own:
            offsets += struct.pack("<Q", place + len(pixels))
            pixels += (struct.pack("<i", number) if several else b"") + chunk
    return data + offsets + pixels
