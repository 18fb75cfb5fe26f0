"""Whether the values of a G-buffer and of light follow the conventions."""
