"""Readers of worlds in other programs' files."""
