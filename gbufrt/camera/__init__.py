"""Where pixels look: the camera, and the only room that knows where a pixel's centre lies."""

from gbufrt.camera.camera import Camera

__all__ = ["Camera"]
