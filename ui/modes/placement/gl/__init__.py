"""The renderer of Placement: see the diagram of `ui.gl`."""
