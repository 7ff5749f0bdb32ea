"""Patch laws: pressure of a patch over its local approach, tabulated, refined, stored.

    LawRows       columns of rows, first touch, repair         `rows`
    PatchLaw      rows of one patch and their interpolants     `patch_law`, `interpolation`
    LawTable      the laws of all patches                      `law_table`, `files`

`consistent` makes rows from contact problems of the whole surface, `isolated` from each patch
alone; `refinement` asks them for more rows where the error between rows is largest.
"""
