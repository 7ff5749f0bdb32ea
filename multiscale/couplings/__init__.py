"""One class for each coupling: all that a scene is used for, from its sections to its fields.

    analytic, concurrent     one contact problem per load step              `micro_coupling`
    consistent, isolated     a law for every patch                          `patch_laws`
    representative           laws of periodic samples at points             `representative`
    reference                the rough surface meshed                       `reference`

`dispatch` is the only place that asks which coupling a scene has; `coupling` has what all share.
"""
