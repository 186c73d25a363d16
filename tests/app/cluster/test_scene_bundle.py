"""What is sent to a cluster, and where its machines keep it."""

from __future__ import annotations

import os
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.cluster import scene_bundle as parcels
from app.cluster.cluster_project import read_inputs
from app.cluster.scene_bundle import FileCache, bundle_files, digest_of, pieces_of
from app.files.materials import Library
from app.project.project import ProjectSpec, open_project
from engine.core.errors import LoadError
from engine.core.safe_files import exists, portable_name, read_regular_file, record_files, redirect_files
from engine.material import MODELS
from engine.material.layer import make_layer
from engine.material.layer_maps import LayerMaps
from engine.render.display import exr_bytes
from tests.app.cli.command_line import SCENE
from tests.engine.scene.loaders.mtlx_samples import document, image, linked, surface


@pytest.fixture(autouse=True)
def small_pieces(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr(parcels, "PIECE", 4)


def test_a_bundle_is_what_its_files_hold(tmp_path: Path) -> None:
    one, other = tmp_path / "a.ply", tmp_path / "b"
    one.write_bytes(b"123456789")
    other.write_bytes(b"")
    sent = bundle_files([other, one])
    assert [(Path(file.name), len(file.pieces)) for file in sent.files] == [(one, 3), (other, 0)]
    assert sent == bundle_files([one, other, one])
    one.write_bytes(b"123456780")
    changed = bundle_files([one, other])
    assert changed.digest != sent.digest and changed.pieces[:2] == sent.pieces[:2]


def test_a_cache_has_the_files_of_a_bundle_and_fetches_what_it_lacks(tmp_path: Path) -> None:
    one = tmp_path / "a.ply"
    one.write_bytes(b"123456789")
    sent, pieces, asked = bundle_files([one]), list(pieces_of(one)), []

    def fetch(digest: str) -> bytes:
        asked.append(digest)
        return next(piece for piece in pieces if digest_of(piece) == digest)

    shelf = FileCache(tmp_path / "shelf")
    place = shelf.places(sent, fetch)[str(one)]
    assert place.read_bytes() == b"123456789" and place.suffix == ".ply" and len(asked) == 3
    assert shelf.places(sent, fetch)[str(one)] == place and len(asked) == 3
    place.write_bytes(b"12345678x")  # somebody has changed it: it is made again
    assert shelf.places(sent, fetch)[str(one)].read_bytes() == b"123456789"


def test_a_cache_hands_out_no_piece_that_was_changed_and_keeps_its_bound(tmp_path: Path) -> None:
    shelf = FileCache(tmp_path, bound=8)
    for content in (b"1111", b"2222"):
        shelf.put(content)
    for file in tmp_path.iterdir():
        os.utime(file, (1, 1))
    assert shelf.piece(digest_of(b"1111")) == b"1111" and shelf.piece(digest_of(b"none")) is None
    shelf.put(b"3333")
    assert shelf.piece(digest_of(b"2222")) is None  # the one used least recently
    next(file for file in tmp_path.iterdir() if file.read_bytes() == b"1111").write_bytes(b"1112")
    assert shelf.piece(digest_of(b"1111")) is None


def test_names_are_the_same_on_every_machine() -> None:
    assert portable_name(Path(__file__)) == "insitu:tests/app/cluster/test_scene_bundle.py"
    assert portable_name("/somewhere/else.ply") == "/somewhere/else.ply"


def test_all_that_a_project_reads_is_noted_and_nothing_else_is_read_elsewhere(tmp_path: Path) -> None:
    file = tmp_path / "ball.toml"
    file.write_text(SCENE)
    with record_files() as noted:
        here = open_project(str(file), values=(("light.environment", "studio"),))
        assert here.sky.environment is not None
    assert file in noted and any(path.suffix == ".exr" for path in noted)
    shelf, sent = FileCache(tmp_path / "shelf"), bundle_files(noted)
    places = shelf.places(sent, {digest_of(piece): piece for path in noted for piece in pieces_of(path)}.__getitem__)
    file.write_text("what it is by now does not matter")
    with redirect_files(places):
        there = open_project(str(file), values=(("light.environment", "studio"),))
        assert (
            there.document == here.document and (there.sky.environment.radiance == here.sky.environment.radiance).all()
        )
        assert exists(file) and not exists(__file__)
        with pytest.raises(LoadError, match="not among the files that were sent"):
            read_regular_file(Path(__file__), 1 << 20)


@pytest.mark.parametrize("material", ["oak.mtlx", "oak.mtlx#it", "leaf.toml", "Leaf"])
def test_materials_and_light_of_other_folders_are_read_elsewhere(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch, material: str
) -> None:
    """A worker has another current folder, and other materials of its user's own."""
    for name in ("scene", "materials", "elsewhere"):
        (tmp_path / name).mkdir()
    file, folder = tmp_path / "scene" / "ball.toml", tmp_path / "materials"
    file.write_text(SCENE)
    Image.new("RGB", (4, 4), (200, 90, 30)).save(folder / "c.png")
    network = image("i", "color3", "c.png", "", "srgb_texture") + surface(
        "standard_surface", linked("base_color", "color3", "i")
    )
    (folder / "oak.mtlx").write_text(document(network))
    (folder / "sky.exr").write_bytes(exr_bytes(np.ones((4, 8, 3), np.float32)))
    leaf = make_layer(MODELS["lambert"], {}, "leaf").replace(maps=LayerMaps(str(folder / "c.png")))
    own = Library().save("Leaf", (leaf,))
    (folder / "leaf.toml").write_bytes(own.path.read_bytes())
    monkeypatch.chdir(folder)
    values = ("ball.material", material), ("light.environment", "sky.exr")
    words = ProjectSpec(str(file), (8, 8), values).with_absolute_paths()
    with record_files() as noted:
        here = words.open()
        read_inputs(here)
    assert folder / "c.png" in noted
    monkeypatch.chdir(tmp_path / "elsewhere")
    monkeypatch.setenv("INSITU_STATE", str(tmp_path / "elsewhere"))
    Library().save("Leaf", (leaf.replace(name="another"),))
    with redirect_files({portable_name(path): path for path in noted}):
        there = words.open()
        read_inputs(there)
    assert there.document == here.document
    assert any(layer.maps.texture.endswith("c.png") for _, layer in there.document.layers())
