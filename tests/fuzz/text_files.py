"""Small sound text files of the program, scenes, sessions, scripts and settings, and their readers."""

from __future__ import annotations

import io
import itertools
from collections.abc import Callable
from pathlib import Path

import numpy as np

ROOT = Path(__file__).resolve().parents[2]


def texts(pattern: str) -> Callable[[Path], list[bytes]]:
    return lambda _: [path.read_bytes() for path in sorted((ROOT / "assets").glob(pattern))]


def read_scene(path: Path) -> None:
    from app.document.described import document_from_description
    from engine.scene.description import load_description

    document_from_description(str(path), load_description(path))


def scenes(folder: Path) -> list[bytes]:
    from tests.app.worker.ball_and_lamp import SCENE

    return [SCENE.encode(), *texts("scenes/*/scene.toml")(folder)]


def sessions(folder: Path) -> list[bytes]:
    """One that says little, and one in which all that there can be differs from its default."""
    from PIL import Image

    from app.document.commands.curves import AddOperator, CollapseOperators
    from app.document.commands.layers import SetFresnelTerm
    from app.document.commands.light import SetEnvironment
    from app.document.commands.maps import Paint, SetMap, SetOpacity
    from app.document.commands.poses import AddDeformer
    from app.document.described import document_from_description
    from app.document.view_state import Bookmark, Viewpoint, ViewState
    from app.files.session import save_session
    from engine.curve.drawing import through_points
    from engine.curve.operators import Operator
    from engine.material.strokes import Stroke, pack_dabs
    from engine.scene.description import Camera, parse_description
    from tests.app.fake_worker import SCENE as SHELF

    plain = edited = document_from_description("shelf", parse_description(SHELF, "scene.toml"))
    lift = Operator("translate", "y", 0.1, 0.2, 1 / 3, 0.4, magnitude=1 / 7, channels=(True, False, True))
    for command in (
        AddOperator("pot.1", "theta_h", lift),
        AddOperator("pot.1", "theta_h", Operator("amplify", "x", 0.0, 0.0, 0.5, 0.5, 1.25, baseline=0.1, muted=True)),
        AddOperator("pot.1", "theta_h", through_points((0.1, 1 / 3), ((1.0, 0.5, 0.25), (2.0, 1.0, 0.5)), 0.05)),
        AddOperator("pot.1", "theta_d", lift),
        CollapseOperators("pot.1", "theta_d"),
        SetFresnelTerm("pot.0", (0.9, 0.5, 0.04)),
        SetMap("floor.0", "texture", "oak.png"),
        SetMap("floor.0", "vertex_colours", True),
        SetOpacity("pot", "opacity_mode", "blend"),
        SetOpacity("pot", "opacity_factor", 1 / 3),
        Paint("floor.0", Stroke(0.1, dabs=pack_dabs(np.eye(3), np.eye(3)))),
        AddDeformer("pot", "bend", 0.5),
        SetEnvironment("constant", "angular", (1.0, 0.1, 1e-5)),
    ):
        edited = command.apply(edited)
    picture = io.BytesIO()
    Image.new("RGB", (16, 12), (200, 100, 50)).save(picture, "JPEG")
    look = Viewpoint(Camera(position=(1 / 3, 1.0, 4.0), target=(0.0, 0.1, 0.0), fov_y=1 / 7), (20, 10))
    view = ViewState(exposure=-1 / 3, tone_mapping="agx", bookmarks=(Bookmark("Above", look, picture.getvalue()),))
    cases = ((plain, ViewState()), (edited, view))
    return [save_session(folder / "seed.insitu", document, view).read_bytes() for document, view in cases]


def read_session(path: Path) -> None:
    from app.files.session import load_session

    for _, layer in load_session(path).document.layers():
        for name in layer.model.curve_names:
            assert np.isfinite(layer.curve(name)(np.array([0.0, 0.7, 1.57]))).all(), name


def read_script(path: Path) -> None:
    from app.operators.script import load_script

    load_script(path)


def read_material(path: Path) -> None:
    from app.files.materials import load_material

    load_material(path)


def materials(folder: Path) -> list[bytes]:
    from app.document.commands.curves import AddOperator
    from app.document.described import document_from_description
    from app.files.materials import Material, dump_material
    from engine.curve.operators import Operator
    from engine.scene.description import parse_description
    from tests.app.fake_worker import SCENE as SHELF

    lift = Operator("translate", "y", 0.1, 0.2, 1 / 3, 0.4, magnitude=1 / 7)
    document = AddOperator("pot.1", "theta_h", lift).apply(
        document_from_description("shelf", parse_description(SHELF, "scene.toml"))
    )
    own = dump_material(Material("Pot", document.object("pot").layers)).encode()
    return [own, *texts("materials/*.toml")(folder)]


def curve_tables(folder: Path) -> list[bytes]:
    return [
        b"# a peak\nangle,red,green,blue\n0,12.5,12,11\n2.5,9,9,9\n2.5,1,1,1\n90,0.1,0.1,0.1\n",
        b"Winkel;Wert\r\n10;1,5\r\n45;0,25\r\n",
        b"10 1 # first\n20\t2\n",
    ]


def read_curve_table(path: Path) -> None:
    from engine.curve.operators import apply_operators
    from engine.curve.table_text import load_table

    curve = apply_operators([load_table(path)], lambda gamma: np.ones((gamma.size, 3)))
    assert np.isfinite(curve(np.linspace(0.0, np.pi / 2, 50))).all() and len(curve.features) < 4200


def preferences(folder: Path) -> list[bytes]:
    from app.files.preferences import PreferenceFile

    PreferenceFile(folder / "seed.toml").choose(mouse="maya", scroll="orbit")
    return [(folder / "seed.toml").read_bytes()]


def read_preferences(path: Path) -> None:
    """What is damaged is as if it were not there: nothing is raised."""
    from app.files.preferences import PreferenceFile, Preferences

    choices = itertools.product(("blender", "maya"), ("dolly", "orbit"), ("blender", "maya", "insitu"))
    assert PreferenceFile(path).current in itertools.starmap(Preferences, choices)


def read_recent(path: Path) -> None:
    from app.files.preferences import RecentFiles

    RecentFiles(path).entries()
