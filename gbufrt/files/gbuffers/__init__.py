"""G-buffers of other renderers: profiles as TOML, and their conversion to a frame."""
