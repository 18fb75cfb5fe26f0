"""Reading and writing of files: EXR and its guard, PNG, debug views."""
