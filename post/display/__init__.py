"""What a display shows of scene light."""
