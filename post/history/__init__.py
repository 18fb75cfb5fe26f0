"""What passes know of the frame before: reprojection, antilag, Catmull-Rom taps."""
