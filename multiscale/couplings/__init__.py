"""Ways to put rough contacts and an elastic block into one equilibrium."""
