"""Sets of variants of USD that change more than materials: what is shown follows the choice by name."""

from __future__ import annotations

from pathlib import Path

import pytest

from app.document.view_state import ViewState
from app.files.session import load_session, save_session
from app.project.project import open_project
from engine.core.errors import LoadError
from engine.scene.import_report import report_lines, report_scene, report_values
from engine.scene.loaders.model import VariantSet
from engine.scene.loaders.usd import read_usd
from engine.scene.scene_loader import load_scene
from tests.usd_text import SQUARE, area, box, mesh_of, unshown, write

pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")


def scaled(size: float) -> str:
    return f'float3 xformOp:scale = ({size}, {size}, {size})\n uniform token[] xformOpOrder = ["xformOp:scale"]\n'


ROOM = f"""def Xform "Room" (
    variants = {{ string shape = "wide"\n string size = "small" }}
    prepend variantSets = ["shape", "size"]
) {{
    variantSet "shape" = {{
        "wide" {{ def Mesh "Card" {{{SQUARE}}} }}
        "split" (prepend variantSets = "gap") {{
            def Mesh "Left" {{{SQUARE}}}
            variantSet "gap" = {{
                "near" {{ over "Left" {{ double3 xformOp:translate = (2, 0, 0)
                    uniform token[] xformOpOrder = ["xformOp:translate"] }} }}
                "far" {{ over "Left" {{ double3 xformOp:translate = (9, 0, 0)
                    uniform token[] xformOpOrder = ["xformOp:translate"] }} }}
            }}
        }}
    }}
    variantSet "size" = {{
        "small" {{ {scaled(1.0)} }}
        "big" {{ {scaled(3.0)} }}
    }}
}}
"""
HEAD = 'defaultPrim = "Room"'


def test_a_variant_of_a_set_is_shown_where_it_is_chosen(tmp_path: Path) -> None:
    path = write(tmp_path / "a.usda", ROOM, HEAD)
    plain = read_usd(path)
    assert area(mesh_of(plain)) == pytest.approx(4.0)
    assert plain.variant_sets == (
        VariantSet("shape", ("split", "wide"), "wide"), VariantSet("size", ("big", "small"), "small")
    )  # fmt: skip
    assert area(mesh_of(read_usd(path, {"size": "big"}))) == pytest.approx(36.0)  # three times as wide and high
    # A set inside a variant is there once that is chosen.
    far = read_usd(path, {"shape": "split", "gap": "far", "size": "big"})
    assert box(mesh_of(far)) == [[24.0, -3.0, 0.0], [30.0, 3.0, 0.0]]
    assert [each.chosen for each in far.variant_sets if each.name == "gap"] == ["far"]


def test_the_report_names_the_sets_and_the_choice(tmp_path: Path) -> None:
    path = write(tmp_path / "a.usda", ROOM, HEAD)
    model = read_usd(path)
    assert unshown(model) == {"variantSets.shape": 1, "variantSets.size": 1}
    assert "shown as wide; others, by --variant shape=NAME: split" in {each.effect for each in model.unshown}
    report = report_scene(load_scene(path, (8, 8), variants={"size": "big"}))
    assert any(line.split() == "variants 2 shape = wide (split, wide), size = big (big, small)".split()
               for line in report_lines(report))  # fmt: skip
    (_, size) = report_values(report)["variant_sets"]
    assert size == {"name": "size", "variants": ("big", "small"), "chosen": "big"}


def test_sets_of_prims_below_are_chosen_together(tmp_path: Path) -> None:
    chair = """def Xform "{name}" (variants = {{ string form = "{own}" }}\n prepend variantSets = "form") {{
        variantSet "form" = {{ "a" {{ {a} }} "b" {{ {b} }} }}
        def Mesh "M" {{{square}}}
    }}
    """
    names = ("One", "a"), ("Two", "b")
    body = "".join(chair.format(name=name, own=own, a=scaled(1.0), b=scaled(2.0), square=SQUARE) for name, own in names)
    path = write(tmp_path / "a.usda", body)
    assert read_usd(path).variant_sets == (VariantSet("form", ("a", "b"), ""),)
    for name, total in (("a", 8.0), ("b", 32.0)):
        assert area(mesh_of(read_usd(path, {"form": name}))) == pytest.approx(total)


@pytest.mark.parametrize(
    ("chosen", "said"),
    [
        ({"colour": "red"}, "set of variants = colour, expected one of shape, size"),
        ({"size": "huge"}, "variant of size = huge, expected big, small"),
    ],
)
def test_what_cannot_be_chosen_is_said_in_one_line(tmp_path: Path, chosen: dict[str, str], said: str) -> None:
    path = write(tmp_path / "a.usda", ROOM, HEAD)
    with pytest.raises(LoadError) as error:
        load_scene(path, (8, 8), variants=chosen)
    assert said in str(error.value) and "\n" not in str(error.value)
    (tmp_path / "a.obj").write_text("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n")
    with pytest.raises(LoadError, match="only stages of USD have some"):
        load_scene(tmp_path / "a.obj", (8, 8), variants=chosen)


def test_names_of_scenes_and_sessions_keep_the_choice(tmp_path: Path) -> None:
    path = write(tmp_path / "a.usda", ROOM, HEAD)
    big = open_project(f"{path}#size=big", (8, 8))
    assert big.scene.bounds[0][1].tolist() == [3.0, 3.0, 0.0]
    session = save_session(tmp_path / "a.insitu", big.document, ViewState())
    assert 'scene = "a.usda#size=big"' in session.read_text()
    assert load_session(session).document.source == f"{path}#size=big"
    assert (open_project(str(session), (8, 8)).scene.bounds == big.scene.bounds).all()
