"""What a person can name to be opened, and what is said of the rest."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.document.sources import Source, find_source, source_of
from engine.core.errors import InsituError


def touch(folder: Path, name: str) -> str:
    (folder / name).write_bytes(b"")
    return str(folder / name)


def test_scenes_meshes_and_sessions_by_their_endings(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.chdir(tmp_path)
    assert source_of("cornell") == Source("cornell")
    for name in ("a.toml", "a.PLY", "a.obj", "a.glb", "a.gltf", "a.stl", "a.off", "a.3MF", "a.zip"):
        touch(tmp_path, name)
        assert source_of(name) == Source(str(tmp_path / name))  # relative to where we are
    touch(tmp_path, "a.insitu")
    assert source_of("a.insitu").session == tmp_path / "a.insitu"


@pytest.mark.parametrize("name", ["sky.exr", "sky.HDR"])
def test_light_opens_the_default_scene(tmp_path: Path, name: str) -> None:
    assert source_of(touch(tmp_path, name)) == Source("teatray", light=tmp_path / name)


@pytest.mark.parametrize(
    ("name", "said"),
    [
        ("gold.binary", "a measured BRDF, a material of its own; open a scene and import it"),
        ("gold.brdf", "a measured BRDF"),
        ("gold.bsdf", "a measured BRDF"),
        ("face.png", "a picture; open a scene and give it to a layer as its texture"),
        ("toy.fbx", "no file that is known, expected a scene (.toml), a session (.insitu), a mesh (.glb, .gltf"),
        ("toy", "a file without an ending, expected a scene"),
    ],
)
def test_other_files_are_named_with_what_to_do(tmp_path: Path, name: str, said: str) -> None:
    for look in (source_of, find_source):
        with pytest.raises(InsituError) as caught:
            look(touch(tmp_path, name))
        assert f"{name}: {said}" in str(caught.value) and "\n" not in str(caught.value)


def test_folders_and_what_is_not_there(tmp_path: Path) -> None:
    with pytest.raises(InsituError, match="no scene in it, expected a scene"):
        find_source(str(tmp_path))
    with pytest.raises(InsituError, match=r"gone\.ply: no such file, and no built-in scene of that name; built-in"):
        find_source(str(tmp_path / "gone.ply"))
    for name in ("x" * 300, "y" * 300 + ".exr", "a\0.toml", "~nobody-of-that-name/a.toml"):
        with pytest.raises(InsituError, match="no such file|built-in scenes are"):
            find_source(name)
