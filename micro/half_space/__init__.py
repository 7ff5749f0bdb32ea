"""The micro model `half-space`: the surface cell by cell, with no assumption on its asperities."""
