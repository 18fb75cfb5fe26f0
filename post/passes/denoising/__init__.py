"""Noise out of signals, in space and over time."""
