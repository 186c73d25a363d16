"""Views that are kept by name, as values."""

from __future__ import annotations

import io
import struct

import numpy as np
import pytest
from PIL import Image

from app.document.view_state import Bookmark, Viewpoint
from app.files.bookmarks import (
    MAX_BOOKMARKS,
    Bookmarks,
    add_bookmark,
    check_thumbnail,
    find_bookmark,
    remove_bookmark,
    rename_bookmark,
    with_thumbnail,
)
from engine.core.errors import InsituError

HERE, THERE = Viewpoint(), Viewpoint(resolution=(20, 10))


def two() -> Bookmarks:
    return add_bookmark(add_bookmark((), HERE), THERE, "Two")


def test_views_are_kept_replaced_renamed_and_deleted() -> None:
    assert two() == (Bookmark("View 1", HERE), Bookmark("Two", THERE))
    assert add_bookmark(with_thumbnail(two(), "View 1", b"jpeg"), THERE, "View 1")[0] == Bookmark(
        "View 1", THERE
    )  # no old picture
    assert find_bookmark(rename_bookmark(two(), "Two", "View 2"), "View 2").viewpoint == THERE
    assert [each.name for each in add_bookmark(remove_bookmark(two(), "View 1"), HERE)] == ["Two", "View 1"]
    assert rename_bookmark(two(), "Two", "Two") == two()


def test_names_differ_and_can_be_read() -> None:
    for name in ("", " ", "a ", "a\nb", "x" * 65):
        with pytest.raises(InsituError, match="1 to 64 characters"):
            rename_bookmark(two(), "Two", name)
        with pytest.raises(InsituError, match="1 to 64 characters"):
            add_bookmark((), HERE, name)
    with pytest.raises(InsituError, match="there is a view 'View 1' already"):
        rename_bookmark(two(), "Two", "View 1")
    with pytest.raises(InsituError, match="no view 'Three'; saved views: View 1, Two"):
        find_bookmark(two(), "Three")


def test_there_are_not_endlessly_many() -> None:
    bookmarks: Bookmarks = tuple(Bookmark(str(n), HERE) for n in range(MAX_BOOKMARKS))
    with pytest.raises(InsituError, match="delete one"):
        add_bookmark(bookmarks, HERE)
    assert add_bookmark(bookmarks, THERE, "7")[7].viewpoint == THERE


def test_a_thumbnail_that_claims_too_much_is_refused_before_it_is_decoded() -> None:
    """A header of 65,500 squared, which the image library alone takes for a bomb and raises an error of its own."""
    buffer = io.BytesIO()
    Image.fromarray(np.zeros((8, 8, 3), np.uint8)).save(buffer, "JPEG")
    data = buffer.getvalue()
    at = data.index(b"\xff\xc0") + 5
    for claimed in (65_500, 12_000):
        spoilt = data[:at] + struct.pack(">HH", claimed, claimed) + data[at + 4 :]
        with pytest.raises(ValueError, match="a JPEG file in base 64 of at most"):
            check_thumbnail(spoilt)
    check_thumbnail(data)
    with pytest.raises(ValueError, match="a JPEG file"):
        check_thumbnail(b"\xff\xd8\xff" + bytes(40))
