"""Resource packs: the textures of blocks, from a jar, a zip or a folder."""
