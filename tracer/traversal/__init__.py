"""Rays through the grids of a scene."""
