"""Light paths: the path tracer's surfaces, bounces and receivers."""
