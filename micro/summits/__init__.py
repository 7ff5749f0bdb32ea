"""Contact problems of interacting asperities, and what they leave."""
