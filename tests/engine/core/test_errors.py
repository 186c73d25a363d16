import pickle

import pytest

from engine.core.errors import (
    LONGEST_LINE,
    MOST_NOTES,
    InsituError,
    LoadError,
    list_names,
    plain_line,
    plain_notes,
    printable_name,
)
from engine.scene.description import parse_description


def test_a_load_error_is_one_line_with_file_place_value_and_expectation():
    error = LoadError("a/scene.toml", "camera: fov_y", -3, "a number from 0.01 to 179")
    assert isinstance(error, InsituError)
    # the wording every loader shares
    assert str(error) == ("a/scene.toml: camera: fov_y = -3, expected a number from 0.01 to 179; nothing was changed")


def test_values_stay_short_printable_and_on_one_line():
    error = LoadError("f", "line 1", "x\n\x1b[31m" + "y" * 500, "text")
    assert str(error).isprintable()  # no line break, no terminal sequence
    assert len(str(error)) < 200  # the value is cut at 80 characters


def test_a_load_error_survives_pickling():
    error = LoadError("f", "w", [1, 2], "numbers")
    assert str(pickle.loads(pickle.dumps(error))) == str(error)  # it crosses between processes


@pytest.mark.parametrize("middle", ["x" * 5_000, "x " * 500_000, "\n" * 3_000 + "y" * 2_000, "\x1b[31m" * 2_000])
def test_long_lines_keep_where_and_what_to_do(middle):
    path, end = "/home/someone/scenes/kitchen.toml", "expected a number; nothing was changed"
    for line in (str(InsituError(f"{path}: {middle}, {end}")), plain_line(f"{path}: {middle}, {end}")):
        assert line.startswith(f"{path}: ") and line.endswith(f", {end}") and " … " in line
        assert len(line) <= LONGEST_LINE and line.isprintable()


def test_lines_of_usual_length_stay_as_they_are():
    line = "a" * 300 + " " + "b" * 150
    assert str(InsituError(line)) == plain_line(line) == line
    assert plain_line(str(InsituError("x" * 9_000))) == str(InsituError("x" * 9_000))  # made shorter once


def test_nothing_in_a_line_acts_on_a_terminal():
    """Escapes, line breaks, marks that turn the writing round, and what of a file's name is no UTF-8."""
    line = plain_line("a\x1b[2Jb\r\nc\u202ed\udcffe\x00\u2028f\tg")
    assert line.isprintable() and line.encode() and [c for c in line if c.isascii() and c.isalpha()] == list("aJbcdefg")


def test_names_of_any_length_in_a_scene_stay_one_line():
    with pytest.raises(LoadError) as caught:
        parse_description({"version": 1, "\x1b" + "k" * 100_000: 1, "object": [{"name": "n" * 100_000}]}, "p" * 4_000)
    assert len(str(caught.value)) <= LONGEST_LINE and str(caught.value).endswith("; nothing was changed")


def test_a_note_of_what_is_left_out_is_as_short_as_the_error_itself():
    error = LoadError("f", "samplers 0: interpolation", "\x1b[31m" + "y" * 1_000_000, "LINEAR")
    assert error.reason.isprintable() and len(error.reason) < 150 and error.reason.endswith(", expected LINEAR")


def test_columns_of_a_table_stay_aligned():
    assert plain_line("a    b\n   c", keep_spaces=True) == "a    b�   c"


def test_notes_are_plain_few_and_said_once():
    notes = plain_notes(["a\nnote: forged", "b", "b", *(f"c {i}" for i in range(100))])
    assert notes[:2] == ("a note: forged", "b") and len(notes) == MOST_NOTES + 1
    assert notes[-1] == f"and {102 - MOST_NOTES} more notes" and all(note.isprintable() for note in notes)


def test_names_from_files_are_cut_and_printable():
    assert printable_name(" a \n b\x1b\ud800 ", 9) == "a b��"
    assert printable_name("x" * 1_000_000, 9) == "x" * 8 + "…" and printable_name("", 9) == ""


def test_a_list_of_names_says_how_many_it_leaves_out():
    assert list_names(["pot"]) == "pot" and list_names("abc", 3) == "a, b, c"
    assert list_names("abcde", 3) == "a, b, c and 2 more"
    assert len(list_names(["x" * 10_000] * 10_000)) < 800
