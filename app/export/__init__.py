"""Scenes exported for other programs: a folder that Mitsuba 3 renders the final frame from."""
