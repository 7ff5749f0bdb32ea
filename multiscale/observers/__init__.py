"""What is read off load steps: those observers that a scene asks for."""
