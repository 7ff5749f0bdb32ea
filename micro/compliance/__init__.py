"""Terms of the compliance beside the half-space's: the rest of a finite body, finite slopes."""
