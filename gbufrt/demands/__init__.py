"""What stages ask of frames, and whether what they return is what they say."""
