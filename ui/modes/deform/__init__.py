"""Deform in the window: its picture source, deformer handles, panel and status."""
