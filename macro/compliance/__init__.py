"""What pressures on a block's top displace there, in smooth modes, and the cache on disk."""
