"""The micro model `islands`: connected regions above the plane as Hertz contacts."""
