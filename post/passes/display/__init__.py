"""From linear light to the finished picture."""
