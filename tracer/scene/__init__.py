"""The scene: voxels, grids, materials, instances."""
