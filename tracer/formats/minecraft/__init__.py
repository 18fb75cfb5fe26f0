"""Minecraft Java: region files and save folders, 1.8 to 26.3, and schematics."""
