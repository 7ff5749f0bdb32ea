"""Couplings: from what is prescribed of the rigid plane to a load step.

    analytic, concurrent     one contact problem per load step             `load_steps`
    consistent, isolated     patch laws on the mesh of a block             `load_steps`
                             patch laws on the compliance of its patches   `condensed`,
                             by a dense Newton's method                    `dense_newton`
    reference                the rough surface meshed                      `reference`

`blocks` and `body_terms` make what the block of a scene is in each of them, `newton_choice` chooses
between mesh and patches, and `assembly` puts laws, block and coupling together.
"""
