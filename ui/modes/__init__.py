"""The modes in the window: for each its picture source, its renderer, and its parts of the panels."""
