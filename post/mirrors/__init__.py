"""What mirrors show: their images as G-buffers, and for how long glossy metals show the same."""
