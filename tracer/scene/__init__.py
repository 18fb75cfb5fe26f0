"""What is there: voxels, grids, materials, instances."""
