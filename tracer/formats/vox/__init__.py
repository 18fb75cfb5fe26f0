"""MagicaVoxel files."""
