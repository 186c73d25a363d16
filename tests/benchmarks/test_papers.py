"""Entries of the papers: all places are there, ours match where the paper has an exact number, pages say all."""

import re
from math import comb
from pathlib import Path

import numpy as np
import pytest

from benchmarks.papers.entries import Work, paragraph, read_paper
from benchmarks.papers.pages import PAPERS, Kept, carry_out, chosen, page, write_pages
from benchmarks.papers.sheets import closeup, difference, sheet
from benchmarks.papers.thesis_increments import didactic
from benchmarks.papers.thesis_precomputation import tensor_terms
from benchmarks.papers.thesis_shadows import Shadows

# What a page must have, with a counterpart or the reason why there is none.
PLACES = {
    "BenArtzi07": [
        *(f"table {n}" for n in (4.2, 6.1, 7.1, 8.1, 8.2, 8.3)),
        *(f"figure {n}" for n in (3.1, 3.2, 3.3, 3.4, 3.5, 3.6, 3.7, 4.3, 4.4, 4.5, 5.3, 5.4, 6.3, 6.5, 7.1, 7.2)),
        *(f"figure {n}" for n in (8.2, 8.7, 8.8, 8.9, "1.2-1.4", "5.5, 5.6", "6.1, 6.4", "9.1-9.4")),
    ],
    "Ma06": [*(f"figure {n}" for n in range(5, 15)), *(f"table {n}" for n in (1, 2, 3))],
    "Sloan05": [f"figure {n}" for n in range(1, 8)],
}


@pytest.fixture
def work(tmp_path: Path) -> Work:
    for name in ("papers", "images"):
        (tmp_path / "docs" / name).mkdir(parents=True)
    return Work(tmp_path / "docs", True, lambda line: None)


@pytest.mark.parametrize("paper", PAPERS, ids=lambda paper: paper.key)
def test_every_figure_and_table_has_a_counterpart_or_a_reason(paper) -> None:
    places = {entry.place for entry in paper.entries}
    assert set(PLACES[paper.key]) <= places
    assert all(entry.printed.endswith(".") and entry.title for entry in paper.entries)
    assert len({entry.name for entry in paper.entries}) == len(paper.entries)


def test_a_maker_for_a_place_that_is_not_there_is_an_error() -> None:
    with pytest.raises(ValueError, match="Ma06: no entry 'figure 99'"):
        read_paper("Ma06", {"figure 99": lambda work: ""})


def test_one_multiplication_a_frame_gives_what_the_thesis_prints(work: Work) -> None:
    rows = [line.split(" | ") for line in didactic(work).splitlines() if re.match(r"\| \d", line)]
    assert [row[2] for row in rows] == ["24", "29", "22"]  # perfect
    assert [row[4] for row in rows] == ["12", "27", "22"]  # incremental
    assert [row[6].strip(" |") for row in rows] == ["12", "12", "12"]  # standard non-linear


def test_terms_are_counted_as_multisets() -> None:
    # Two bases, two bounces: 11, 12, 21, 22, of which 12 and 21 are one.
    assert (tensor_terms(2, 2, False), tensor_terms(2, 2, True)) == (4, 3)
    assert tensor_terms(5, 4, True) == comb(8, 4) == 70


def test_white_surfaces_under_few_lights_are_a_plain_sum() -> None:
    shadows = Shadows.of("shapes", 16, 20)
    seen = shadows.seen("TRUE")
    picture = shadows.picture(seen).reshape(-1, 3)
    hits, lights = shadows.placement.hits, shadows.lights
    row = len(hits.pixel) // 2
    expected, visible = np.zeros(3), seen.unpacked(np.array([row]))[0]
    for m in range(len(lights.centre)):
        expected += 0.7 / np.pi * visible[m] * max(0.0, float(hits.normal[row] @ lights.centre[m])) * lights.power[m]
    np.testing.assert_allclose(picture[hits.pixel[row]], expected, rtol=1e-4)
    assert expected.any()


def test_entries_are_carried_out_one_by_one_and_kept(work: Work, tmp_path: Path) -> None:
    kept, name = Kept(tmp_path / "kept"), "benartzi07/figure-3.1"
    carry_out(work, kept, [name, "benartzi07/table-7.1"], "On a machine.")
    carry_out(work, kept, [name], "On a machine.")
    text = (work.papers / "benartzi07.md").read_text()
    assert "On a machine." in text and "(4, 3, 0) | 27" in text and "../images/phong_curves.png" in text
    assert (work.images / "phong_curves.png").exists()
    assert text.count("Not carried out in this run.") == len(list(chosen(["benartzi07"]))) - 2
    for paper in PAPERS:
        for entry in paper.entries:
            assert entry.title in page(paper, kept, "")
    write_pages(work.papers, kept, "Another.")
    assert "Another." in (work.papers / "ma06.md").read_text()


def test_sheets_put_pictures_beside_each_other() -> None:
    red, blue = (np.full((4, 5, 3), colour, np.uint8) for colour in ((200, 0, 0), (0, 0, 200)))
    found = sheet(["a", "b"], [[red, blue]])
    assert found.shape == (20 + 4, 2 * 5 + 6, 3)
    assert (found[20:, :5] == red).all() and (found[20:, 11:] == blue).all()
    half = np.concatenate([red, blue], axis=1)
    assert (closeup(half, 0.5, 0.0, 0.5)[:, :] == (0, 0, 200)).all()
    truth = np.full((2, 2, 3), 2.0)
    assert (difference(truth + 0.25, truth, 0.25) == 128).all()  # half of a quarter of the mean


def test_paragraphs_are_wrapped_as_pages_are() -> None:
    assert all(len(line) <= 120 for line in paragraph("word " * 100).splitlines())
