"""What modes of pressure displace on top of a block: few elements of high order, by symmetry."""
