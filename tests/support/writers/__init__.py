"""Writers of files that other programs write: worlds, texture packs, G-buffers."""
