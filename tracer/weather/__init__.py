"""Weather: rain and the sky that it falls from, puddles, rings round drops; waves, and the sun that they reflect."""
