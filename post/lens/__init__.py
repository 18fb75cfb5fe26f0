"""The spread of light by a lens: layers of like blur, each spread by its own disc."""
