"""A scene or session opened by name, with values set by path: what commands and the Python interface work on."""
