"""What pressures on a face displace there, in smooth modes, and the cache on disk."""
