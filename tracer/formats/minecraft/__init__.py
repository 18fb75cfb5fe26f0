"""Minecraft Java: region files and save folders, 1.8 to 1.21, and schematics."""
