"""What a scene file says, read and checked section by section."""
