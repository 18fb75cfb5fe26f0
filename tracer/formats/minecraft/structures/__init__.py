"""Blocks of structures that lie apart from a world: Litematica's ``.litematic``, and the game's own ``.nbt``."""
