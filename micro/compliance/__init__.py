"""Terms of the compliance beside the half-space's: free sides, finite body, finite slopes."""
