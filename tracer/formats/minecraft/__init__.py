"""Minecraft Java: region files and save folders, 1.12 to 1.21, and schematics."""
