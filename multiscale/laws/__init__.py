"""Patch laws: pressure of a patch over its local approach, tabulated, refined, stored.

    LawRows, PlanePath    columns of rows, first touch, repair; the plane's path    `rows`
    LawCurves, LawPoint   interpolants over the approach, what they give            `interpolation`
    PatchLaw, PatchLaws   the law of one patch, and of many at once                 `patch_law`
    LawTable              the laws of all patches, and their file                   `law_table`

`of_patches` makes rows from contact problems of the whole surface, or of each patch alone,
`of_samples` from periodic samples of a large face; `refinement` asks them for more rows where the
error between rows is largest; `transmissivity` adds what leaks, `running_in` what has worn.
`gap_flows` is the flow through the gaps of cells; `exports` writes laws for other programs.
"""
