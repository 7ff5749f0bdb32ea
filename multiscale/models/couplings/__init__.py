"""From a scene to the model of its contacts: one class for each coupling.

    analytic, concurrent     one contact problem per load step              `cells`
    consistent, isolated     a law for every patch                          `patch_laws`
    representative           laws of periodic samples at points             `representative`
    reference                the rough surface meshed                       `reference`

`dispatch` knows them by their names, `coupling` has what all share, `about` what is said of them.
"""
