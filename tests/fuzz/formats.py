"""The kinds of files that people hand in, each with small sound ones by the project's own writers, and its reader.

A reader takes a file as the program does, and looks at what it made of it: it may raise `InsituError`, or nothing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass
from pathlib import Path

from tests.fuzz.data_files import (
    cornells,
    entries,
    merls,
    read_cornell_file,
    read_entry,
    read_merl_file,
    read_tensors,
    read_tiles,
    tensors,
    tiles,
)
from tests.fuzz.gltf_seeds import dracos, gltfs, meshopts
from tests.fuzz.mesh_files import (
    archives,
    daes,
    glbs,
    models,
    mtls,
    mtlxs,
    objs,
    offs,
    plys,
    read_animated_file,
    read_archive,
    read_library,
    read_mesh_file,
    read_model,
    read_mtlx_file,
    stls,
)
from tests.fuzz.picture_files import exrs, hdrs, jpegs, ktx2s, pngs, read_light, read_texture_file, webps
from tests.fuzz.repair import repaired_glb, repaired_png, repaired_records
from tests.fuzz.text_files import (
    curve_tables,
    materials,
    preferences,
    read_curve_table,
    read_material,
    read_preferences,
    read_recent,
    read_scene,
    read_script,
    read_session,
    scenes,
    sessions,
    texts,
)
from tests.fuzz.usd_seeds import usdas, usdcs


@dataclass(frozen=True)
class Format:
    """name: of the files that are read, in a folder of their own; seeds: sound ones, made in a folder; repaired: with
    its checksums made right; share: of the inputs that are asked for, as many are read."""

    name: str
    seeds: Callable[[Path], Iterable[bytes]]
    read: Callable[[Path], object]
    is_text: bool = False
    repaired: Callable[[bytes], bytes] | None = None
    share: float = 1.0


FORMATS = {
    "scene": Format("scene.toml", scenes, read_scene, is_text=True),
    "session": Format("a.insitu", sessions, read_session, is_text=True),
    "script": Format("script.toml", texts("scripts/*.toml"), read_script, is_text=True),
    "material": Format("material.toml", materials, read_material, is_text=True),
    "preferences": Format("preferences.toml", preferences, read_preferences, is_text=True),
    "recent": Format("recent.txt", lambda _: [b"/tmp/a.toml\n/tmp/b c.insitu\n"], read_recent, is_text=True),
    "table": Format("a.csv", curve_tables, read_curve_table, is_text=True),
    "ply": Format("a.ply", plys, read_mesh_file),
    "obj": Format("a.obj", objs, read_mesh_file, is_text=True),
    "mtl": Format("a.mtl", mtls, read_library, is_text=True),
    "stl": Format("a.stl", stls, read_mesh_file),
    "off": Format("a.off", offs, read_mesh_file, is_text=True),
    "dae": Format("a.dae", daes, read_mesh_file, is_text=True),
    "3mf": Format("a.model", models, read_model, is_text=True),
    "mtlx": Format("a.mtlx", mtlxs, read_mtlx_file, is_text=True),
    "zip": Format("a.zip", archives, read_archive),
    "glb": Format("a.glb", glbs, read_animated_file, repaired=repaired_glb),
    "gltf": Format("a.gltf", gltfs, read_animated_file, is_text=True),
    "meshopt": Format("a.glb", meshopts, read_animated_file, repaired=repaired_glb),
    "draco": Format("a.glb", dracos, read_animated_file, repaired=repaired_glb),
    "usda": Format("a.usda", usdas, read_animated_file, is_text=True),
    "usdc": Format("a.usdc", usdcs, read_animated_file),
    "exr": Format("a.exr", exrs, read_light),
    "hdr": Format("a.hdr", hdrs, read_light),
    "exr_texture": Format("t.exr", exrs, read_texture_file),
    "png": Format("a.png", pngs, read_texture_file, repaired=repaired_png),
    "jpeg": Format("a.jpg", jpegs, read_texture_file),
    "webp": Format("a.webp", webps, read_texture_file),
    "basis": Format("a.ktx2", ktx2s, read_texture_file),
    "cornell": Format("a.brdf", cornells, read_cornell_file, is_text=True),
    "tensors": Format("a.bsdf", tensors, read_tensors),
    "entry": Format("k.arrays", entries, read_entry, repaired=repaired_records),
    "tiles": Format("k.tiles", tiles, read_tiles, repaired=repaired_records),
    "merl": Format("a.binary", merls, read_merl_file, share=0.02),
}
