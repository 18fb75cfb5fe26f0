"""Estimates of light, and how they make a picture."""
