"""Connected regions of a surface above a plane, and the contacts that stand for them."""
