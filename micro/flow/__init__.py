"""Flow through the gaps of a contact: Reynolds' equation on the cells of a map of gaps."""
