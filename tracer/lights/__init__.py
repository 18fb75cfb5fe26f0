"""Sky, sun and lamps: what shines, how it is sampled, and its shadows."""
