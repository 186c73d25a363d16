"""Files that another program has saved again are read again; edits, undo and camera stay.

Scenes are read and traced by the worker's own code in this process; the picture is not computed.
"""

from __future__ import annotations

import base64
import itertools
import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.document.commands import EditCommand
from app.document.commands.curves import AddOperator
from app.document.commands.layers import SetParameter, SetVisible
from app.document.commands.light import SetRotation
from app.document.commands.maps import SetMap, SetOpacity
from app.document.commands.plan import OverrideLine
from app.document.view_state import SetView
from app.editor.editor import Editor
from app.messages.worker_messages import OpenScene, Request, SetCamera
from app.operators.registry import run_operator
from app.worker.schedule import InProcessClient, Steps
from app.worker.tasks import RequestDispatcher
from engine.curve.operators import Operator
from engine.scene.description import Camera
from tests.pictures import write_exr
from tests.scene_text import camera, environment, material, placed, scaled

LIFT = Operator("translate", "y", 0.2, 0.4, 0.6, 0.8, magnitude=0.5)
TETRAHEDRON = "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 1 4 3\nf 2 3 4\n"
NAMES = ("pot", "lid", "cup")


class ReadingWorker(RequestDispatcher):
    """Reads and traces scenes, and counts the views that it traces; no picture is asked of it."""

    n_traced = 0

    def handle(self, request: Request) -> Steps:
        if isinstance(request, OpenScene | SetCamera):
            self.n_traced += isinstance(request, SetCamera)
            yield from super().handle(request)


class Workshop:
    """A folder of files that "another program" writes, and the editor that has them open."""

    def __init__(self, folder: Path) -> None:
        self.folder, self.file = folder, folder / "scene.toml"
        self.grey = dict.fromkeys(NAMES, 0.5)
        self.names = list(NAMES)
        self.write_sky(0.5)
        (folder / "solid.obj").write_text(TETRAHEDRON)
        self.write()
        self.editor = Editor(InProcessClient(ReadingWorker()), str(self.file))
        self.now = 0.0
        self.settle()

    def write(self) -> None:
        """Save the scene as it should be now."""
        made = {name: material(f'model = "lambert", albedo = {grey}') for name, grey in self.grey.items()}
        objects = [placed(n, "solid.obj", scaled(0.5, (k, 0, 0)), made[n]) for k, n in enumerate(self.names)]
        text = camera((0, 0, 5), resolution=(8, 6), head='name = "shelf"\nbounces = 1\n') + environment(file="sky.exr")
        self.file.write_text(text + "".join(objects))

    def write_sky(self, radiance: float) -> None:
        write_exr(self.folder / "sky.exr", np.full((2, 4, 3), radiance, np.float32))

    def settle(self) -> None:
        """Frames until the worker has nothing to do."""
        for _ in range(40):
            self.now += 0.5
            self.editor.tick(self.now)

    def do(self, command: EditCommand) -> None:
        assert self.editor.do(command) is None

    def reload(self) -> None:
        assert run_operator(self.editor, "reload") is None
        self.settle()

    def albedo(self, name: str) -> object:
        return self.editor.document.layer(f"{name}.0").values["albedo"]


@pytest.fixture
def shop(tmp_path: Path) -> Workshop:
    return Workshop(tmp_path)


def test_what_the_file_says_now_is_shown_and_edits_stay(shop: Workshop) -> None:
    shop.do(AddOperator("pot.0", "theta_i", LIFT))
    moved = Camera(position=(1.0, 1.0, 5.0), target=(0.0, 0.0, 0.0))
    shop.editor.do(SetView.of(camera=moved))
    shop.settle()
    shop.grey["pot"] = 0.9
    shop.write()
    shop.reload()
    assert shop.albedo("pot") == (0.9, 0.9, 0.9) and shop.editor.document.layer("pot.0").operators("theta_i") == (LIFT,)
    assert shop.editor.view.camera == moved
    assert shop.editor.status.message == "reloaded shelf" and not shop.editor.status.is_error
    assert shop.editor.undo() is not None and not shop.editor.document.layer("pot.0").edits
    assert shop.albedo("pot") == (0.9, 0.9, 0.9)  # the file itself is not undone
    assert shop.editor.undo() is None and shop.editor.redo() is not None


def test_an_object_that_is_gone_is_reported_and_returns_with_its_edits(shop: Workshop) -> None:
    shop.do(SetParameter("lid.0", "albedo", 0.1))
    shop.editor.select("lid")
    shop.names.remove("lid")
    shop.write()
    shop.reload()
    assert "no longer there: lid" in shop.editor.status.message and shop.editor.status.is_error
    assert [state.name for state in shop.editor.document.objects] == ["pot", "cup"]
    assert shop.editor.view.selected is not None and shop.editor.view.selected.object == "pot"
    shop.reload()
    assert not shop.editor.status.is_error  # said once
    shop.names.append("lid")
    shop.write()
    shop.reload()
    assert shop.albedo("lid") == (0.1, 0.1, 0.1) and not shop.editor.document.absent


def test_a_mesh_and_an_environment_are_read_again(shop: Workshop) -> None:
    opened = shop.editor.scenes.report
    assert opened.files == ("scene.toml", "sky.exr", "solid.obj") and opened.n_triangles == 12
    (shop.folder / "solid.obj").write_text(TETRAHEDRON + "v 1 1 1\nf 2 3 5\n")
    shop.reload()
    assert shop.editor.scenes.report.n_triangles == 15
    # The worker's own copy of the sky is given up, too.
    worker = shop.editor._client._schedule._handler  # type: ignore[attr-defined]
    assert worker.context.sky(shop.editor.document.light).environment.radiance.max() == 0.5
    shop.write_sky(2.0)
    shop.reload()
    assert worker.context.sky(shop.editor.document.light).environment.radiance.max() == 2.0


def test_a_texture_is_read_again(shop: Workshop) -> None:
    worker = shop.editor._client._schedule._handler  # type: ignore[attr-defined]

    def mean_of_texture() -> float:
        scene = worker.context.open_placement.scene
        images = shop.editor.document.layer("pot.0").maps.images
        return float(scene.textures.texture(images).texels[-1].mean())

    write_exr(shop.folder / "wood.exr", np.full((2, 2, 3), 0.25, np.float32))
    shop.do(SetMap("pot.0", "texture", "wood.exr"))
    assert mean_of_texture() == pytest.approx(0.25, rel=1e-3)
    write_exr(shop.folder / "wood.exr", np.full((2, 2, 3), 0.75, np.float32))
    shop.reload()
    assert shop.editor.document.layer("pot.0").maps.texture == "wood.exr"
    assert mean_of_texture() == pytest.approx(0.75, rel=1e-3)


def test_the_first_view_has_the_edits(shop: Workshop) -> None:
    """Else the picture would be begun for what the file says, and once more for what the user has made of it."""
    worker = shop.editor._client._schedule._handler  # type: ignore[attr-defined]
    shop.do(SetOpacity("cup", "opacity_factor", 0.2))
    shop.do(SetOpacity("cup", "opacity_mode", "mask"))
    shop.do(OverrideLine("edges", 4))
    shop.settle()
    before = worker.n_traced
    shop.reload()
    assert worker.n_traced == before + 1 and shop.editor.document.object("cup").opacity.opacity_mode == "mask"
    assert worker.context.open_placement.scene.cutouts.passable.any()


def test_a_broken_file_leaves_all_as_it_is(shop: Workshop) -> None:
    shop.do(SetRotation(40.0))
    before, picture = shop.editor.document, shop.editor.scenes.opened
    shop.file.write_text("version = 1\n[camera")
    shop.reload()
    assert shop.editor.document is before and shop.editor.scenes.opened is picture
    assert "scene.toml" in shop.editor.status.message and shop.editor.status.is_error
    shop.write()
    shop.reload()
    assert shop.editor.document == before and shop.editor.status.message == "reloaded shelf"


def test_edits_while_the_files_are_being_read_stay(shop: Workshop) -> None:
    shop.grey["cup"] = 0.7
    shop.write()
    assert run_operator(shop.editor, "reload") is None
    shop.editor.begin_drag()
    shop.do(SetParameter("pot.0", "albedo", 0.2))
    shop.settle()
    shop.do(SetParameter("pot.0", "albedo", 0.3))
    shop.editor.end_drag()
    assert shop.albedo("pot") == (0.3, 0.3, 0.3) and shop.albedo("cup") == (0.7, 0.7, 0.7)
    shop.editor.undo()
    assert shop.albedo("pot") == (0.5, 0.5, 0.5) and shop.editor.undo() is None  # one drag, one step


def test_a_saved_session_stays_saved_and_one_written_elsewhere_is_opened(shop: Workshop) -> None:
    shop.do(SetParameter("pot.0", "albedo", 0.2))
    assert shop.editor.save(shop.folder / "mine.insitu") is None
    shop.grey["cup"] = 0.7
    shop.write()
    shop.reload()
    assert not shop.editor.session.is_unsaved and shop.editor.session.path == shop.folder / "mine.insitu"
    text = (shop.folder / "mine.insitu").read_text()
    (shop.folder / "mine.insitu").write_text(text.replace("0.2", "0.25"))
    shop.do(SetRotation(10.0))
    shop.reload()  # the edit here is not saved
    assert shop.albedo("pot") == (0.2, 0.2, 0.2) and shop.editor.session.is_unsaved
    shop.editor.undo()
    assert not shop.editor.session.is_unsaved
    shop.reload()
    assert shop.albedo("pot") == (0.25, 0.25, 0.25) and shop.editor.session.path == shop.folder / "mine.insitu"
    (shop.folder / "mine.insitu").write_text(text[: len(text) // 2])  # another program is still writing it
    before = shop.editor.document
    assert "mine.insitu" in str(run_operator(shop.editor, "reload"))
    shop.settle()
    assert shop.editor.document is before


def test_a_scene_that_is_being_opened_is_not_given_up(shop: Workshop) -> None:
    assert shop.editor.open("cornell") is None
    assert run_operator(shop.editor, "reload") == "cornell is being opened; its files are read now"
    shop.settle()
    assert shop.editor.document.source == "cornell"


def write_gltf(path: Path, materials: list[str]) -> None:
    """A triangle of each material, side by side."""
    corners = np.array([[0, 0, 0], [1, 0, 0], [0, 1, 0]], np.float32)
    places = np.concatenate([corners + (2.0 * k, 0, 0) for k in range(len(materials))]).astype("<f4")
    uri = f"data:application/octet-stream;base64,{base64.b64encode(places.tobytes()).decode()}"
    accessors = [
        {"bufferView": 0, "byteOffset": 36 * k, "componentType": 5126, "count": 3, "type": "VEC3"}
        for k in range(len(materials))
    ]
    primitives = [{"attributes": {"POSITION": k}, "material": k} for k in range(len(materials))]
    tree = {
        "asset": {"version": "2.0"}, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}], "accessors": accessors,
        "meshes": [{"primitives": primitives}], "buffers": [{"byteLength": places.nbytes, "uri": uri}],
        "bufferViews": [{"buffer": 0, "byteLength": places.nbytes}],
        "materials": [{"name": name, "pbrMetallicRoughness": {"metallicFactor": 0.0}} for name in materials],
    }  # fmt: skip
    path.write_text(json.dumps(tree))


def test_parts_of_a_gltf_file_are_found_again_by_their_materials(tmp_path: Path) -> None:
    write_gltf(tmp_path / "bag.gltf", ["leather", "brass"])
    editor = Editor(InProcessClient(ReadingWorker()), str(tmp_path / "bag.gltf"))

    clock = itertools.count(1)

    def settle() -> None:
        for _ in range(20):
            editor.tick(0.5 * next(clock))

    settle()
    assert [item.material for item in editor.scenes.report.objects] == ["leather", "brass"]
    editor.do(SetVisible("brass", False))
    write_gltf(tmp_path / "bag.gltf", ["zip", "brass", "thread", "leather"])
    run_operator(editor, "reload")
    settle()
    assert editor.scenes.report.objects[1].material == "brass"
    assert [state.visible for state in editor.document.objects[:4]] == [True, False, True, True]
    write_gltf(tmp_path / "bag.gltf", ["brass", "leather"])
    run_operator(editor, "reload")
    settle()
    assert [state.visible for state in editor.document.objects[:2]] == [False, True]


def test_a_part_that_has_the_place_of_another_has_none_of_its_edits(tmp_path: Path) -> None:
    write_gltf(tmp_path / "bag.gltf", ["leather", "brass"])
    editor = Editor(InProcessClient(ReadingWorker()), str(tmp_path / "bag.gltf"))
    clock = itertools.count(1)

    def reload(*materials: str) -> None:
        write_gltf(tmp_path / "bag.gltf", list(materials))
        run_operator(editor, "reload")
        for _ in range(20):
            editor.tick(0.5 * next(clock))

    for _ in range(20):
        editor.tick(0.5 * next(clock))
    editor.do(SetVisible("leather", False))
    editor.select("leather")
    reload("zip", "leather", "brass")
    assert [state.visible for state in editor.document.objects[:3]] == [True, False, True]
    assert editor.view.selected is not None and editor.view.selected.object == "leather"
    reload("zip", "brass")  # no leather, and brass has its place
    assert [state.visible for state in editor.document.objects[:2]] == [True, True]
    assert "no longer there: leather" in editor.status.message and editor.status.is_error
    reload("leather", "brass")
    assert [state.visible for state in editor.document.objects[:2]] == [False, True] and not editor.document.absent


def test_cameras_that_a_file_has_got_become_views(tmp_path: Path) -> None:
    def write(*names: str) -> None:
        write_gltf(tmp_path / "bag.gltf", ["leather"])
        tree = json.loads((tmp_path / "bag.gltf").read_text())
        tree["cameras"] = [{"type": "perspective", "perspective": {"yfov": 0.7}}]
        nodes = [{"camera": 0, "name": name, "translation": [0, 0, 5]} for name in names]
        tree |= {"nodes": [*tree["nodes"], *nodes], "scenes": [{"nodes": list(range(1 + len(names)))}]}
        (tmp_path / "bag.gltf").write_text(json.dumps(tree))

    write("Front")
    editor = Editor(InProcessClient(ReadingWorker()), str(tmp_path / "bag.gltf"))
    clock = itertools.count(1)

    def settle() -> list[str]:
        for _ in range(20):
            editor.tick(0.5 * next(clock))
        return [each.name for each in editor.view.bookmarks]

    assert settle() == ["Front"]
    editor.view = replace(editor.view, bookmarks=())  # the user has deleted it: it does not come back
    write("Front", "Back")
    run_operator(editor, "reload")
    assert settle() == ["Back"]
    run_operator(editor, "reload")
    assert settle() == ["Back"]


def test_changed_files_are_noticed_until_they_are_read(shop: Workshop) -> None:
    watch = shop.editor.scenes.watch
    for _ in range(2):
        watch.look()
    assert shop.editor.status.changed_files == ()
    (shop.folder / "solid.obj").write_text(TETRAHEDRON + "# saved again\n")
    for _ in range(2):
        watch.look()
    (changed,) = shop.editor.status.changed_files
    assert Path(changed).name == "solid.obj"
    shop.reload()
    for _ in range(2):
        watch.look()
    assert shop.editor.status.changed_files == ()


# ----------------------------------------------------------------------------------------------------- random sequences


def _paint(shop: Workshop, random: np.random.Generator) -> None:
    """The other program paints an object."""
    name = str(random.choice(NAMES))
    shop.grey[name] = round(float(random.uniform(0.1, 0.9)), 3)
    shop.write()


def _leave_out(shop: Workshop, random: np.random.Generator) -> None:
    """The other program leaves out an object, or has it again."""
    name = str(random.choice(NAMES))
    if name not in shop.names:
        shop.names.append(name)
    elif len(shop.names) > 1:
        shop.names.remove(name)
    shop.write()


def _edit(shop: Workshop, random: np.random.Generator) -> None:
    name = str(random.choice([state.name for state in shop.editor.document.objects]))
    value = round(float(random.uniform(0.1, 0.9)), 3)
    commands = (
        SetParameter(f"{name}.0", "albedo", value), SetVisible(name, bool(random.integers(2))),
        AddOperator(f"{name}.0", "theta_i", LIFT), SetRotation(float(random.integers(360))),
    )  # fmt: skip
    shop.do(commands[random.integers(len(commands))])


STEPS: tuple[Callable[[Workshop, np.random.Generator], object], ...] = (
    _paint,
    _leave_out,
    _edit,
    _edit,
    lambda shop, random: shop.editor.undo(),
    lambda shop, random: shop.editor.redo(),
    lambda shop, random: shop.reload(),
    lambda shop, random: run_operator(shop.editor, "reload"),  # and go on at once
    lambda shop, random: shop.settle(),
    lambda shop, random: shop.editor.save(shop.folder / "walk.insitu"),
)


@pytest.mark.parametrize("seed", range(6))
def test_in_any_order_the_scene_is_the_files_with_the_edits_on_top(shop: Workshop, seed: int) -> None:
    """After a reload at the end: the objects are the files'; a value that was never edited is the files' as well; all
    that can be undone and redone is a document of that scene; and a session of it opens to the same document."""
    random = np.random.default_rng(seed)
    for _ in range(40):
        STEPS[random.integers(len(STEPS))](shop, random)
    shop.settle()
    shop.reload()
    editor = shop.editor
    assert [state.name for state in editor.document.objects] == shop.names
    last = editor.document
    while editor.undo() is not None:
        assert [state.name for state in editor.document.objects] == shop.names
    # The oldest document has no edits: it is what the files say.
    for name in shop.names:
        assert shop.albedo(name) == (shop.grey[name],) * 3 and not editor.document.layer(f"{name}.0").edits
    while editor.redo() is not None:
        assert [state.name for state in editor.document.objects] == shop.names
    assert editor.document == last
    assert editor.save(shop.folder / "end.insitu") is None and not editor.session.is_unsaved
    again = Editor(InProcessClient(ReadingWorker()), str(shop.folder / "end.insitu"))
    for now in range(1, 20):
        again.tick(float(now))
    assert again.document == editor.document
