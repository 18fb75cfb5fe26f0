"""Use of the previous frame: reprojection, antilag, Catmull-Rom taps."""
