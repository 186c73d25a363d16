"""Small sound pictures, and their readers."""

from __future__ import annotations

import io
import struct
from pathlib import Path

import numpy as np

from tests.fuzz.text_files import ROOT

GRADIENT = np.linspace(0.0, 4.0, 12 * 8 * 3, dtype=np.float32).reshape(8, 12, 3)
SQUARE = np.ascontiguousarray(GRADIENT[:, :8])


def exrs(folder: Path) -> list[bytes]:
    import OpenEXR

    from engine.render.display import exr_bytes
    from tests.naive.exr_files import ExrPart, exr_file

    found, path = [exr_bytes(GRADIENT, "a seed"), exr_bytes(SQUARE)], folder / "seed.exr"
    for kind, compression in ((np.float16, OpenEXR.NO_COMPRESSION), (np.float32, OpenEXR.PIZ_COMPRESSION)):
        channels = {name: np.ascontiguousarray(GRADIENT[..., i].astype(kind)) for i, name in enumerate("RGB")}
        with OpenEXR.File({"compression": compression, "type": OpenEXR.scanlineimage}, channels) as file:
            file.write(str(path))
        found.append(path.read_bytes())
    aces = (0.7347, 0.2653, 0.0, 1.0, 0.0001, -0.077, 0.32168, 0.33767)
    with OpenEXR.File({"chromaticities": aces, "type": OpenEXR.scanlineimage}, {"RGB": GRADIENT}) as file:
        file.write(str(path))
    name = b"displayWindow\0box2i\0" + struct.pack("<i", 16)
    within = found[0].replace(name + struct.pack("<4i", 0, 0, 11, 7), name + struct.pack("<4i", -3, 2, 8, 20))
    planes = {name: np.ascontiguousarray(GRADIENT[..., i]) for i, name in enumerate("RGB")}
    chroma = {"RY": planes["R"][::2, ::2], "BY": planes["B"][::2, ::2].astype(np.float16)}
    variants = (
        (ExrPart({"Z": planes["R"]}, name="depth"), ExrPart(planes, tile=5, is_mip_map=True, name="beauty")),
        (ExrPart({"Y": planes["G"]} | chroma, {"RY": (2, 2), "BY": (2, 2)}),),
        (ExrPart({"diffuse.R": planes["R"].astype(np.uint32), "diffuse.G": planes["G"].astype(np.float16)}, tile=8),),
    )
    cube = {name: np.ones((18, 3), np.float32) for name in "RGB"}
    return [*found, path.read_bytes(), within, *(exr_file(*parts) for parts in variants), exr_file(ExrPart(cube))]


def hdrs(folder: Path) -> list[bytes]:
    from tests.engine.light.conftest import gradient
    from tests.engine.light.test_hdr_files import flat_scanlines, packed_scanlines, rgbe, write_hdr

    quads = rgbe(gradient())
    header = b"EXPOSURE=2\r\nCOLORCORR=1 2 1\nPRIMARIES=0.7 0.3 0.2 0.8 0.1 0.05 0.31 0.33\n"
    columns = packed_scanlines(quads.swapaxes(0, 1))
    turned = write_hdr(folder / "turned.hdr", columns, b"-X 40 +Y 24", header).read_bytes()
    seeds = [write_hdr(folder / "seed.hdr", pack(quads)).read_bytes() for pack in (flat_scanlines, packed_scanlines)]
    return [*seeds, turned, turned.replace(b"rgbe", b"xyze")]


def read_light(path: Path) -> None:
    from engine.light.environment import load_environment
    from engine.light.probe_mappings import MAPPINGS, mapping_problem
    from engine.light.radiance_files import read_radiance_image

    height, width, _ = read_radiance_image(path).shape
    for mapping in MAPPINGS:
        if mapping_problem(mapping, width, height) is None:
            radiance = load_environment(path, mapping).radiance
            assert np.isfinite(radiance).all() and radiance.min() >= 0.0


def pngs(_: Path) -> list[bytes]:
    from PIL import Image

    from engine.render.display import deep_png, pixels_png

    pixels = (GRADIENT * 60).astype(np.uint8)
    found = [pixels_png(pixels), deep_png(GRADIENT / 4.0)]
    for picture in (Image.fromarray(pixels[..., 0]), Image.fromarray(pixels).convert("P"),
                    Image.fromarray((pixels[..., 0].astype(np.int32) * 200).astype(np.uint16))):  # fmt: skip
        buffer = io.BytesIO()
        picture.save(buffer, "PNG", compress_level=0)
        found.append(buffer.getvalue())
    return found


def jpegs(_: Path) -> list[bytes]:
    from PIL import Image

    found = []
    for options in ({}, {"progressive": True}):
        buffer = io.BytesIO()
        Image.fromarray((GRADIENT * 60).astype(np.uint8)).save(buffer, "JPEG", **options)
        found.append(buffer.getvalue())
    return found


def webps(_: Path) -> list[bytes]:
    from PIL import Image

    found = []
    for options in ({"lossless": True}, {"quality": 80}, {"lossless": True, "exif": b"Exif\0\0II*\0\x08\0\0\0\0\0"}):
        buffer = io.BytesIO()
        Image.fromarray((GRADIENT * 60).astype(np.uint8)).save(buffer, "WebP", **options)
        found.append(buffer.getvalue())
    return found


def ktx2s(_: Path) -> list[bytes]:
    return [path.read_bytes() for path in sorted((ROOT / "tests" / "engine" / "texture" / "ktx2").glob("*.ktx2"))]


def read_texture_file(path: Path) -> None:
    from engine.texture.texture_files import read_texture, read_weight

    data = path.read_bytes()
    assert np.isfinite(read_texture(data, path)).all()
    assert np.isfinite(read_weight(data, path)).all()
