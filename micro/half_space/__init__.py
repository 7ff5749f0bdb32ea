"""The micro model `half-space`: the surface cell by cell, with no assumption on its asperities.

HalfSpaceModel           surface, E* and what the body adds    `model`
  └ PlaneContact         a plane, prescribed or free           `plane_contact`
      └ ContactSolver    the contact problem on the cells      `micro.contact`
HalfSpaceState           pressures, gaps, contacts             `state`, `contact_spots`
Response                 sums over patches                     `patch_sums`
"""
