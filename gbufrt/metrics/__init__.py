"""How far pictures and sequences of them are from others."""
