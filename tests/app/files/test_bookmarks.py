"""Views that are kept by name, as values."""

from __future__ import annotations

import pytest

from app.files.bookmarks import MAX_BOOKMARKS, Bookmarks, kept, named, renamed, with_thumbnail, without
from app.view_state import Bookmark, Viewpoint
from engine.errors import InsituError

HERE, THERE = Viewpoint(), Viewpoint(resolution=(20, 10))


def two() -> Bookmarks:
    return kept(kept((), HERE), THERE, "Two")


def test_views_are_kept_replaced_renamed_and_deleted() -> None:
    assert two() == (Bookmark("View 1", HERE), Bookmark("Two", THERE))
    assert kept(with_thumbnail(two(), "View 1", b"jpeg"), THERE, "View 1")[0] == Bookmark(
        "View 1", THERE
    )  # no old picture
    assert named(renamed(two(), "Two", "View 2"), "View 2").look == THERE
    assert [each.name for each in kept(without(two(), "View 1"), HERE)] == ["Two", "View 1"]
    assert renamed(two(), "Two", "Two") == two()


def test_names_differ_and_can_be_read() -> None:
    for name in ("", " ", "a ", "a\nb", "x" * 65):
        with pytest.raises(InsituError, match="1 to 64 characters"):
            renamed(two(), "Two", name)
        with pytest.raises(InsituError, match="1 to 64 characters"):
            kept((), HERE, name)
    with pytest.raises(InsituError, match="there is a view 'View 1' already"):
        renamed(two(), "Two", "View 1")
    with pytest.raises(InsituError, match="no view 'Three'; kept views: View 1, Two"):
        named(two(), "Three")


def test_there_are_not_endlessly_many() -> None:
    bookmarks: Bookmarks = tuple(Bookmark(str(n), HERE) for n in range(MAX_BOOKMARKS))
    with pytest.raises(InsituError, match="delete one"):
        kept(bookmarks, HERE)
    assert kept(bookmarks, THERE, "7")[7].look == THERE
