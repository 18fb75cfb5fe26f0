"""What is read and written: EXR behind its guard, PNG, debug views."""
