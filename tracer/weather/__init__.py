"""Weather: rain and the sky that it falls from, puddles, and rings round drops."""
