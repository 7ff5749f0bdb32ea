"""What loads on a block's contact face displace there: under patches and in smooth modes."""
