"""Placement in the window: its picture source, the feeds of its images, its renderer, and its part of the Accuracy
panel.
"""
