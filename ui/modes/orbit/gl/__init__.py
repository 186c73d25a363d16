"""The pictures of Orbit, which the worker draws: they only have to be shown."""
