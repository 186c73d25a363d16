"""What a person keeps: sessions and their journal, materials and the library of them, bookmarks, preferences."""
