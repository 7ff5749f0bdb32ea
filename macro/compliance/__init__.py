"""What loads on a face displace there, in smooth modes or by patches, and the cache on disk."""
