"""Error metrics of pictures and of sequences."""
