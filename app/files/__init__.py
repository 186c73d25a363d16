"""The user's files: sessions and their journal, materials and the library of them, bookmarks, preferences."""
