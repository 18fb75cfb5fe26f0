"""Directions to scatter into, sequences to draw them from, and running means."""
