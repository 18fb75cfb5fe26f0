"""Weather: rain and the sky that it falls from, puddles, rings round drops, and waves of water."""
