"""Visibility of directions and lights from points, stored as bits."""
