"""Minecraft regions and saves as scenes: land, what lies beyond it, and where to look from."""
