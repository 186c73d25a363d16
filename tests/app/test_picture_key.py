"""The key of a picture: every field of a project counts, and so do the files that it was read from."""

from __future__ import annotations

import dataclasses
import json
from collections.abc import Callable, Iterator, Mapping
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from pydantic import BaseModel

from app.cli.turntable import parts_of, picture_key
from app.project.project import Project, open_project
from app.stills.frame_sequence import Frames
from app.worker.cache import content_key
from engine.scene.builtin import builtin_scenes
from engine.texture.texture_store import TextureStore
from tests.engine.realtime.zonal_harmonics.test_animated_pose import write_bar
from tests.scene_text import camera, placed

BUMP = 'bump_map = { file = "bump.png", height = 0.01 }\n'
DEFORM = "deform = { membrane = { translucency = 0.4 } }\n"
OBJ = "v 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nvt 1 0\nvt 0 1\nf 1/1 2/2 3/3\n"


@pytest.fixture
def scene(tmp_path: Path) -> Path:
    """A triangle with bumps and a membrane's surface, and a bar that an animation moves."""
    Image.new("L", (4, 4), 90).save(tmp_path / "bump.png")
    (tmp_path / "leaf.obj").write_text(OBJ)
    write_bar(tmp_path)
    path = tmp_path / "scene.toml"
    leaf = '[[object]]\nname = "leaf"\nmesh = "leaf.obj"\n' + BUMP + DEFORM
    path.write_text(
        camera((0.0, 0.5, 3.0), 40, (8, 6))
        + "[environment]\nradiance = [1, 1, 1]\n"
        + leaf
        + '[[object]]\nname = "bar"\nmesh = "bar.glb"\n'
        + placed("ball", "sphere")
    )
    return path


def values_in(value: object) -> Iterator[tuple[object, str]]:
    """All fields of all values that a value is made of."""
    if isinstance(value, TextureStore):
        return
    if isinstance(value, BaseModel):
        names = list(type(value).model_fields)
    elif dataclasses.is_dataclass(value):
        names = [field.name for field in dataclasses.fields(value)]
    else:
        inner = value.values() if isinstance(value, Mapping) else value if isinstance(value, (tuple, list)) else ()
        for each in inner:
            yield from values_in(each)
        return
    for name in names:
        yield value, name
        yield from values_in(getattr(value, name))


def test_every_field_counts(scene: Path) -> None:
    """Another value in any field of anything that a project and the frames of it have gives another key."""
    whole = (open_project(str(scene)), Frames(3))
    before, fields = content_key(parts_of(whole)), list(values_in(whole))
    assert len(fields) > 200
    uncounted = []
    for owner, name in fields:
        value = vars(owner)[name]
        if isinstance(value, TextureStore):
            continue
        vars(owner)[name] = "another"
        if content_key(parts_of(whole)) == before:
            uncounted.append(f"{type(owner).__name__}.{name}")
        vars(owner)[name] = value
    assert not uncounted and content_key(parts_of(whole)) == before


def test_a_new_field_counts() -> None:
    larger = dataclasses.make_dataclass("Frames", [("tint", float, 0.0)], bases=(Frames,), frozen=True)
    assert content_key(parts_of(larger(3))) != content_key(parts_of(larger(3, tint=0.5)))


def test_a_value_of_an_unknown_kind_is_an_error() -> None:
    with pytest.raises(TypeError, match="object in what a picture depends on"):
        parts_of((1, object()))


def replaced(name: str, old: str, new: str) -> Callable[[Path], None]:
    def change(folder: Path) -> None:
        text = (folder / name).read_text()
        assert old in text
        (folder / name).write_text(text.replace(old, new))

    return change


def other_bump(folder: Path) -> None:
    Image.new("L", (4, 4), 91).save(folder / "bump.png")


def other_animation(folder: Path) -> None:
    path = folder / "bar.glb"
    content = bytearray(path.read_bytes())
    n = int.from_bytes(content[12:16], "little")
    head = json.loads(content[20 : 20 + n])
    sampler = head["animations"][0]["samplers"][0]
    view = head["bufferViews"][head["accessors"][sampler["output"]]["bufferView"]]
    at = 20 + n + 8 + view.get("byteOffset", 0) + view["byteLength"] - 4
    last = np.frombuffer(content[at : at + 4], np.float32)[0]
    content[at : at + 4] = np.float32(last * 0.5 + 0.125).tobytes()
    path.write_bytes(content)


@pytest.mark.parametrize(
    "change",
    [
        replaced("scene.toml", "height = 0.01", "height = 0.02"),
        other_bump,
        replaced("leaf.obj", "vt 1 0", "vt 2 0"),
        replaced("scene.toml", "translucency = 0.4", "translucency = 0.5"),
        other_animation,
    ],
    ids=["bump height", "bump file", "texture coordinates", "deform", "animation"],
)
def test_what_is_read_again_for_another_picture_gives_another_key(scene: Path, change: Callable[[Path], None]) -> None:
    before = picture_key(open_project(str(scene)), Frames(2))
    assert picture_key(open_project(str(scene)), Frames(2)) == before
    change(scene.parent)
    assert picture_key(open_project(str(scene)), Frames(2)) != before


@pytest.mark.parametrize("name", list(builtin_scenes())[:3])
def test_built_in_scenes_have_one(name: str) -> None:
    project: Project = open_project(name, (8, 6))
    assert picture_key(project, Frames(2)) == picture_key(open_project(name, (8, 6)), Frames(2))
