"""The micro model `half-space`: the surface cell by cell, with no assumption on its asperities.

HalfSpaceModel           surface, E*, what the body adds       `model`
  └ solve_contact        the contact problem on the cells      `micro.complementarity`
Stiffness                dF/dδ of a solution                   `stiffness`
ContactState             spots, fields, sums over patches      `contact_spots`
"""
