"""Patch laws: pressure of a patch over its local approach, tabulated, refined, stored.

    LawRows, PlanePath    columns of rows, first touch, repair; the plane's path    `rows`
    LawCurves, LawPoint   interpolants over the approach, what they give            `interpolation`
    PatchLaw, PatchLaws   the law of one patch, and of many at once                 `patch_law`
    LawTable              the laws of all patches, and their file                   `law_table`

`consistent` makes rows from contact problems of the whole surface, `isolated` from each patch
alone, `representative` from periodic samples of a large face (`periodic_sample`, `mean_law`);
`refinement` asks them for more rows where the error between rows is largest.
"""
