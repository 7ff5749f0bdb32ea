"""What a scene file says, read and checked section by section."""

from multiscale.scene.scene import Scene

__all__ = ["Scene"]
