"""The micro model `half-space`: the surface cell by cell, with no assumption on its asperities.

HalfSpaceModel           surface, E* and what the body adds    `model`
  └ PlaneContact         a plane, prescribed or free           `plane_contact`
      └ solve_contact    the contact problem on the cells      `micro.contact`
HalfSpaceState           pressures, gaps, sums over patches    `plane_contact`, `contact_spots`
"""
