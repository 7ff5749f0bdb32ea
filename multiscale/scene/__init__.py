"""What a scene file says, read and checked section by section."""

from patchlaw.multiscale.scene.scene import Scene

__all__ = ["Scene"]
