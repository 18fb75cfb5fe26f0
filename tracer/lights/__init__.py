"""Sky, sun and lamps: their emission, their sampling and their shadows."""
