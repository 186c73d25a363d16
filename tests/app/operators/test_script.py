"""Scripts are read whole: typed steps, or one line that names what is wrong."""

from pathlib import Path

import pytest

from app.operators.curve_drawing import CurvePoints, CurveStroke
from app.operators.edits import Drag
from app.operators.files import CurveTable, MeasuredFile
from app.operators.script import Step, load_script
from engine.core.errors import LoadError

ALL_STEPS = """
[[step]]
set = {"teapot.1.alpha" = 0.3, "teapot.0.albedo" = [1, 0.5, 0], "tray.visible" = false}
[[step]]
select = "teapot.1.theta_h"
[[step]]
drag = {item = "curve.b", by = [40, -25]}
[[step]]
drag = {from = [10, 20.5], to = [30, 40]}
[[step]]
show = "brdf"
[[step]]
lobe = [3, 4]
[[step]]
view = "ACES 2.0"
[[step]]
rotate = 45.0
[[step]]
measured = {file = "cloth.binary", cloth = true}
[[step]]
table = {file = "peak.csv"}
[[step]]
draw_curve = {points = [[30, 0.5], [0, 2]], channel = "r"}
[[step]]
set_points = {points = [[0, 2], [12.5, 0.5]]}
[[step]]
undo = 1
[[step]]
redo = 2
[[step]]
wait = "exact"
[[step]]
capture = "FILE.png"
[[step]]
assert_error_below = 0.01
"""


def test_all_kinds_of_steps(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text(ALL_STEPS)
    assert load_script(tmp_path / "s.toml") == (
        Step("set", {"teapot.1.alpha": 0.3, "teapot.0.albedo": (1.0, 0.5, 0.0), "tray.visible": False}),
        Step("select", "teapot.1.theta_h"),
        Step("drag", Drag(item="curve.b", by=(40.0, -25.0))),
        Step("drag", Drag.model_validate({"from": (10.0, 20.5), "to": (30.0, 40.0)})),
        Step("show", "brdf"),
        Step("lobe", (3, 4)),
        Step("view", "ACES 2.0"),
        Step("rotate", 45.0),
        Step("measured", MeasuredFile(file="cloth.binary", cloth=True)),
        Step("table", CurveTable(file="peak.csv")),
        Step("draw_curve", CurveStroke(points=((30.0, 0.5), (0.0, 2.0)), channel="r")),
        Step("set_points", CurvePoints(points=((0.0, 2.0), (12.5, 0.5)))),
        Step("undo", 1),
        Step("redo", 2),
        Step("wait", "exact"),
        Step("capture", tmp_path / "FILE.png"),
        Step("assert_error_below", 0.01),
    )


def test_captures_go_to_their_paths(tmp_path: Path) -> None:
    (tmp_path / "s.toml").write_text('[[step]]\ncapture = "a/b.PNG"')
    assert load_script(tmp_path / "s.toml", tmp_path / "out") == (Step("capture", tmp_path / "out" / "a" / "b.PNG"),)


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("", "step = nothing"),
        ("step = []", "at least 1 items"),
        ("step = 3", "step = 3"),
        ("[[steps]]\nundo = 1", "step = nothing"),
        ("[[step]]", "exactly one of set, select, drag"),
        ("[[step]]\nundo = 1\nredo = 1", "exactly one of set, select, drag"),
        ("[[step]]\nundo = 1\n[[step]]\njump = 1", "step 1: jump = 1, expected one of set, select"),
        ("[[step]]\nundo = 0", "step 0: undo = 0"),
        ("[[step]]\nundo = true", "step 0: undo = True"),
        ("[[step]]\nundo = 1.5", "step 0: undo = 1.5"),
        ("[[step]]\nwait = 'long'", "step 0: wait = long"),
        ("[[step]]\nrotate = nan", "step 0: rotate = nan"),
        ("[[step]]\nrotate = 'left'", "step 0: rotate = left"),
        ("[[step]]\nset = {}", "step 0: set"),
        ("[[step]]\nsave_view = ' a'", "s.toml: step 0: save_view = a, expected a name of 1 to 64 characters"),
        ("[[step]]\ncamera = {}", "at least one of own, side, focal, frame, orbit"),
        ("[[step]]\ncamera = {orbit = [1]}", "step 0: camera: orbit 1 = nothing"),
        ("[[step]]\ncamera = {dolly = 0}", "step 0: camera: dolly = 0"),
        ("[[step]]\ncamera = {focal = nan}", "step 0: camera: focal = nan"),
        ("[[step]]\ncamera = {side = 'below'}", "step 0: camera: side = below"),
        ("[[step]]\ncamera = {roll = 1}", "step 0: camera: roll = 1, expected one of own, side"),
        ("[[step]]\nset = {'a.alpha' = inf}", "a.alpha = inf"),
        ("[[step]]\nset = {'a.alpha' = {}}", "a.alpha"),
        ("[[step]]\nselect = ''", "step 0: select"),
        ("[[step]]\ndrag = {item = 'curve.b'}", "step 0: drag"),
        ("[[step]]\ndrag = {item = 'curve.b', by = [1, 2], to = [3, 4]}", "item and by, or from and to"),
        ("[[step]]\ndrag = {from = [1, 2], to = [3]}", "step 0: drag: to 1 = nothing"),
        ("[[step]]\ndrag = {from = [1, 2], to = [3, 4, 5]}", "step 0: drag: to"),
        ("[[step]]\ndrag = {from = [1, 2], to = [3, 1e9]}", "step 0: drag: to 1"),
        ("[[step]]\npicture = 'a.jpg'", "step 0: picture = a.jpg, expected a file name that ends in .png or .exr"),
        ("[[step]]\nsave_as = 'a.toml'", "step 0: save_as = a.toml, expected a file name that ends in .insitu"),
        ("[[step]]\ncapture = 'a.exr'", "step 0: capture = a.exr, expected a file name that ends in .png"),
        ("[[step]]\nassert_error_below = 0", "step 0: assert_error_below = 0"),
        ("[[step]]\nundo = ", "TOML"),
    ],
)
def test_bad_scripts_are_named(tmp_path: Path, text: str, says: str) -> None:
    path = tmp_path / "s.toml"
    path.write_text(text)
    with pytest.raises(LoadError) as caught:
        load_script(path)
    line = str(caught.value)
    assert line.startswith(f"{path}: ") and says in line and "\n" not in line
