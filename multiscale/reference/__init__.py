"""The rough surface itself, meshed: what couplings are measured with, and its own error."""
