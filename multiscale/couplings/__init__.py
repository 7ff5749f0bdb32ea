"""Couplings: from what is prescribed of the rigid plane to a load step.

    analytic, concurrent     one contact problem per load step             `contact`
    consistent, isolated     patch laws on the mesh of a block             `law_couplings`
                             patch laws on the compliance of its patches,
                             by a dense Newton's method                    `condensed`
    reference                the rough surface meshed                      `reference`

`body` makes what the block of a scene is in each of them. `assembly` puts laws, block and coupling
together, and chooses between mesh and patches.
"""
