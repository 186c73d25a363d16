"""`insitu diff`: the number, the picture, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from PIL import Image

from engine.render.display import exr_bytes
from engine.render.picture_difference import difference_colours
from tests.app.cli.command_line import run
from tests.pictures import write_flawed_exr

Captured = pytest.CaptureFixture[str]


def write(file: Path, light: np.ndarray) -> Path:
    file.write_bytes(exr_bytes(light.astype(np.float32)))
    return file


def test_it_prints_the_error_and_writes_false_colours(tmp_path: Path, capsys: Captured) -> None:
    reference = np.full((4, 5, 3), 2.0)
    ours = reference.copy()
    ours[:2] *= 0.9  # half of the pixels 10 % too dark: relRMSE 0.1 sqrt(1/2) = 0.07071, means differ by 5 %
    ours[3, 1] *= 1.0005
    a, b, out = write(tmp_path / "a.exr", ours), write(tmp_path / "b.exr", reference), tmp_path / "d.png"
    assert run("diff", a, b, "-o", out) == 0
    said = capsys.readouterr().out
    assert "relRMSE 0.07071" in said and "means differ by -0.05" in said and "0.1 of the mean at 0, 0" in said
    expected = difference_colours(ours.astype(np.float32), reference, "signed")
    np.testing.assert_array_equal(np.asarray(Image.open(out)), expected)
    assert run("diff", a, b, "-o", out, "--absolute") == 0
    assert (np.asarray(Image.open(out)) != expected).any()


def test_what_cannot_be_compared_is_one_line(tmp_path: Path, capsys: Captured) -> None:
    a, b = write(tmp_path / "a.exr", np.ones((4, 5, 3))), write(tmp_path / "b.exr", np.ones((5, 4, 3)))
    gap, text = tmp_path / "gap.exr", tmp_path / "c.png"
    write_flawed_exr(gap, np.where(np.arange(5)[:, None] == 2, np.nan, np.ones((4, 5, 3))).astype(np.float32))
    text.write_text("no picture")
    for words, says in (
        ((a, b), "b.exr: 4 x 5 pixels, expected 5 x 4"),
        ((a, text), "c.png: first bytes"),
        ((a, gap), "gap.exr: pixel 2, 0"),
        ((a, tmp_path / "none.exr"), "none.exr: file"),
        ((a, a, "-o", a), "ends in .png"),
    ):
        assert run("diff", *words) == 1
        lines = capsys.readouterr().err.splitlines()
        assert len(lines) == 1 and says in lines[0], lines
