"""Stages at half resolution: frames of every second pixel, and their signals interpolated along surfaces."""
