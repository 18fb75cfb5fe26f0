"""Light that paths have found, kept in the world."""
