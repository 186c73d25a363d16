"""Documents of MaterialX from untrusted files: includes stay in the folder, everything is bounded."""

from pathlib import Path

import pytest

from engine.core.errors import LoadError
from engine.scene.loaders.mtlx_xml import read_document
from tests.engine.scene.loaders.mtlx_samples import document

INCLUDE = '<xi:include href="{}"/>'


def written(folder: Path, text: str, name: str = "main.mtlx") -> Path:
    path = folder / name
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_text(text, encoding="utf-8")
    return path


def test_includes_are_replaced_by_what_they_contain(tmp_path: Path) -> None:
    # The included root's colour space and prefix go to its elements, and files are named from the first one's folder.
    written(
        tmp_path, document('<a fileprefix="in/"/><b/>', root='colorspace="acescg" fileprefix="maps/"'), "sub/x.mtlx"
    )
    found = read_document(written(tmp_path, document(f"<first/>{INCLUDE.format('sub/x.mtlx')}<last/>")))
    text = found.xml.decode()
    assert "<first></first>" in text and text.index("first") < text.index("<a") < text.index("last")
    assert '<a colorspace="acescg" fileprefix="sub/in/">' in text
    assert '<b colorspace="acescg" fileprefix="sub/maps/">' in text
    assert found.unshown == ()


@pytest.mark.parametrize("name", ["../secret.mtlx", "/etc/passwd", "file:///etc/passwd", "absent.mtlx", ""])
def test_an_include_outside_of_the_folder_is_listed_and_not_read(tmp_path: Path, name: str) -> None:
    written(tmp_path, document("<secret/>"), "secret.mtlx")
    found = read_document(written(tmp_path, document(INCLUDE.format(name)), "in/main.mtlx"))
    assert b"secret" not in found.xml and b"root:" not in found.xml
    assert [each.name for each in found.unshown] == [f"xi:include {name}".strip()]


def test_files_that_include_each_other_are_read_once(tmp_path: Path) -> None:
    written(tmp_path, document(f"<b/>{INCLUDE.format('main.mtlx')}"), "b.mtlx")
    found = read_document(written(tmp_path, document(f"{INCLUDE.format('b.mtlx')}{INCLUDE.format('b.mtlx')}")))
    assert found.xml.count(b"<b>") == 1


def test_too_many_files_are_refused(tmp_path: Path) -> None:
    for k in range(80):
        written(tmp_path, document(INCLUDE.format(f"{k + 1}.mtlx")), f"{k}.mtlx")
    with pytest.raises(LoadError, match="included files = more than 64, expected at most 64"):
        read_document(tmp_path / "0.mtlx")


@pytest.mark.parametrize(
    ("text", "line"),
    [
        ('<!DOCTYPE m [<!ENTITY a "aa"><!ENTITY b "&a;&a;">]><materialx>&b;</materialx>', "a document type"),
        ("<materialx><a></materialx>", "well-formed XML"),
        ("", "well-formed XML"),
        ("<a>" * 70 + "</a>" * 70, "depth = 65, expected at most 64"),
        ("<materialx>" + "<a/>" * 50_001 + "</materialx>", "elements = more than 50000"),
        ("<other/>", "document = other, expected a document of MaterialX"),
    ],
)
def test_bombs_and_damage_are_one_line(tmp_path: Path, text: str, line: str) -> None:
    with pytest.raises(LoadError, match=line):
        read_document(written(tmp_path, text))
