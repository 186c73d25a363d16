"""What a USD file refers to: files in its folder and archives, and nothing else."""

from __future__ import annotations

import zipfile
from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from app.system.decoder_process import DecoderProcess
from engine.core import native_decoders
from engine.core.errors import LoadError
from engine.core.safe_files import record_files
from engine.scene.loaders.usd import read_usd
from engine.scene.scene_loader import load_scene
from tests.usd_text import CARD, READER, card_of, material, place, read, texture, unshown, usda, write

pytest.importorskip("pxr", reason="usd-core, the extra insitu[usd], is not installed")

USE = 'def "{0}" (prepend references = @{1}@{2}) {{ }}\n'


def use(file: str, prim: str = "", name: str = "Used") -> str:
    return USE.format(name, file, prim)


def part_file(path: Path, body: str = CARD, default: str = "Card") -> Path:
    path.parent.mkdir(parents=True, exist_ok=True)
    return write(path, body, f'defaultPrim = "{default}"')


def packed(path: Path, files: dict[str, bytes], compression: int = zipfile.ZIP_STORED) -> Path:
    with zipfile.ZipFile(path, "w", compression) as archive:
        for name, data in files.items():
            archive.writestr(name, data)
    return path


def picture(path: Path) -> bytes:
    Image.fromarray(np.random.default_rng(1).integers(0, 255, (4, 4, 3), np.uint8)).save(path)
    return path.read_bytes()


def test_references_payloads_and_sublayers_in_the_folder(tmp_path: Path) -> None:
    part_file(tmp_path / "parts" / "card.usda")
    part_file(tmp_path / "parts" / "inner.usda", use("./card.usda"), "Used")  # relative to its own layer
    (tmp_path / "below.usda").write_text(usda(f'def Mesh "Below" {{}}\n{CARD.replace("Card", "Sub")}'))
    body = use("parts/inner.usda") + 'def "P" (prepend payload = @./parts/card.usda@) { }'
    with record_files() as files:
        model = read(tmp_path, body, "subLayers = [@below.usda@]")
    assert sum(len(part.mesh.triangles) for part in model.parts) == 6 and not model.unshown
    assert {path.name for path in files} == {"a.usda", "card.usda", "inner.usda", "below.usda"}  # for reloading


@pytest.mark.parametrize(
    "name", ["../outside.usda", "{outside}", "https://example.org/a.usda", "gone.usda", "a.usda:SDF_FORMAT_ARGS:x=1"]
)
def test_what_leads_elsewhere_is_listed_and_never_opened(tmp_path: Path, name: str) -> None:
    outside = part_file(tmp_path / "outside.usda")
    (tmp_path / "in").mkdir()
    name = name.format(outside=outside)
    with record_files() as files:
        model = read(tmp_path / "in", CARD + "\n" + use(name, "" if "SDF" not in name else "</Card>"))
    assert sum(len(part.mesh.triangles) for part in model.parts) == 2
    assert list(unshown(model)) == [f"references.{name[:79] + '…' if len(name) > 80 else name}"]
    assert all(path.parent == tmp_path / "in" for path in files)


def test_the_last_part_of_a_strange_path_is_tried_in_the_folder(tmp_path: Path) -> None:
    part_file(tmp_path / "card.usda")
    model = read(tmp_path, use("/home/someone/assets/card.usda"))
    assert len(model.parts[0].mesh.triangles) == 2


def test_expressions_variants_and_clips_open_nothing(tmp_path: Path) -> None:
    part_file(tmp_path / "card.usda")
    clips = """def Xform "C" (clips = { dictionary default = {
        asset[] assetPaths = [@/etc/hostname@]
        string primPath = "/Card"
        asset manifestAssetPath = @/etc/hostname@
        double2[] active = [(0, 0)]
        double2[] times = [(0, 0)]
    } }) { }"""
    variant = """def Xform "V" (variants = { string look = "a" }\n prepend variantSets = "look") {
        variantSet "look" = { "a" { } "b" ( prepend references = @../secret.usda@ ) { } }
    }"""
    model = read(tmp_path, CARD + clips + variant + use('`"card.usda"`', name="E"))
    assert unshown(model) == {
        "clips": 1, "references.../secret.usda": 1, 'references.`"card.usda"`': 1, "variantSets.look": 1,
    }  # fmt: skip


def test_circles_of_references_end(tmp_path: Path) -> None:
    for a, b in (("one", "two"), ("two", "one")):
        part_file(tmp_path / f"{a}.usda", CARD + use(f"{b}.usda", name="Next"), "Next")
    model = read(tmp_path, CARD + use("one.usda") + use("a.usda", "</Used>", "Self"))
    assert len(model.parts) == 1 and any("composition" in note for note in model.notes)


def test_an_archive_has_its_layers_and_images(tmp_path: Path) -> None:
    look = material("M", "color3f inputs:diffuseColor.connect = </M/T.outputs:rgb>", READER + texture("T", "0/a.png"))
    inner = usda(look + card_of("M"))
    root = usda("", "subLayers = [@./sub/inner.usda@]")
    files = {"root.usda": root.encode(), "sub/inner.usda": inner.encode(), "0/a.png": picture(tmp_path / "a.png")}
    path = packed(tmp_path / "a.usdz", files)
    model = read_usd(path)
    maps = model.parts[0].layers[0].maps
    assert maps.texture == "#2" and len(model.parts) == 1
    scene = load_scene(path, (8, 8))
    assert scene.description.objects[0].layers[0].maps.texture == "a.usdz#2"
    assert scene.textures.texture(scene.description.objects[0].layers[0].maps.images) is not None
    # Seen from a layer in its folder.
    seen = load_scene(write(tmp_path / "b.usda", "", "subLayers = [@a.usdz@]"), (8, 8))
    assert seen.description.objects[0].layers[0].maps.texture == "a.usdz#2"
    assert read_usd(packed(path, files, zipfile.ZIP_DEFLATED)).parts  # not as the format has it, but readable


@pytest.mark.parametrize(
    ("files", "said"),
    [
        ({"a.png": b"x", "b.usda": usda(CARD).encode()}, "first file of the archive = a.png"),
        ({}, "first file of the archive = none"),
        ({"../a.usda": usda(CARD).encode()}, "name in the archive = ../a.usda"),
        ({"a.usda": b"hello"}, "first bytes"),
    ],
)
def test_archives_that_are_no_stages_are_refused(tmp_path: Path, files: dict[str, bytes], said: str) -> None:
    with pytest.raises(LoadError) as error:
        read_usd(packed(tmp_path / "a.usdz", files))
    assert said in str(error.value)


def test_an_archive_reaches_no_file_beside_it(tmp_path: Path) -> None:
    part_file(tmp_path / "card.usda")
    stage = usda(CARD + use("../card.usda") + use("/card.usda", name="B"))
    model = read_usd(packed(tmp_path / "a.usdz", {"a.usda": stage.encode()}))
    assert set(unshown(model)) == {"references.../card.usda", "references./card.usda"}


def test_binary_layers_are_as_those_of_text(tmp_path: Path) -> None:
    from pxr import Sdf

    body = f'def Xform "A" {{{place(1, 2, 3)} {CARD} }}'
    expected = read(tmp_path, body).parts[0].mesh
    Sdf.Layer.FindOrOpen(str(tmp_path / "a.usda")).Export(str(tmp_path / "b.usdc"))
    (tmp_path / "c.usd").write_bytes((tmp_path / "b.usdc").read_bytes())
    for name in ("b.usdc", "c.usd"):
        mesh = read_usd(tmp_path / name).parts[0].mesh
        assert np.array_equal(mesh.vertices, expected.vertices) and np.array_equal(mesh.triangles, expected.triangles)


def test_a_stage_is_read_in_a_process_of_its_own(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    process = DecoderProcess()
    monkeypatch.setattr(native_decoders, "_runners", [process])
    try:
        model = read(tmp_path, CARD)
        with pytest.raises(LoadError, match="USD = "):
            broken = tmp_path / "b.usdc"
            broken.write_bytes(b"PXR-USDC" + b"\xff" * 200)
            read_usd(broken)
    finally:
        process.close()
    assert len(model.parts[0].mesh.triangles) == 2


def test_layers_are_limited_in_number(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("engine.scene.loaders.usd_layers.MOST_LAYERS", 2)
    for name in ("b", "c"):
        part_file(tmp_path / f"{name}.usda")
    model = read(tmp_path, CARD + use("b.usda", name="B") + use("c.usda", name="C"))
    assert len(model.parts[0].mesh.triangles) == 4 and set(unshown(model)) == {"references.c.usda"}
