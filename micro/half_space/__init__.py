"""The micro model `half-space`: the surface cell by cell, with no assumption on its asperities.

HalfSpaceModel           surface, E*, what the body adds       `model`
  └ solve_contact        the contact problem on the cells      `micro.complementarity`
ContactState             spots, sums over patches, dF/dδ       `read_off`
ErrorProbe               its errors by cause                   `error_probe`
"""
