"""The contact problem: pressures between bounds, gaps, rigid motions prescribed or free."""
