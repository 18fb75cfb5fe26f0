"""Light that surfaces send and reflect: GGX, lobes, the thin lens."""
