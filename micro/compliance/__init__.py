"""Terms of the compliance of a contact: what displaces the face beside the half-space."""
