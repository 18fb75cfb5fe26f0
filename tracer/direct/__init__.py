"""Direct light of sun and lamps at the pixels of a picture."""
