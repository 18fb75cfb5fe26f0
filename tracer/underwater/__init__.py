"""Water round the camera: what it takes from light and adds to it, and its surface seen from below."""
