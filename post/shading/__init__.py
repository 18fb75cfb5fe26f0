"""What surfaces send and mirror: GGX, lobes, the thin lens."""
