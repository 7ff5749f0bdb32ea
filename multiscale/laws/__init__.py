"""Patch laws: pressure of a patch over its local approach, tabulated, refined, stored.

    LawRows, PlanePath    columns of rows, first touch, repair; the plane's path    `rows`
    LawCurves, LawPoint   interpolants over the approach, what they give            `interpolation`
    PatchLaw, PatchLaws   the law of one patch, of many                             `patch_law`
    RunningInLaws         laws of samples that wear, SlidLaws those of patches      `worn_laws`
    LawTable              the laws of all patches, and their file                   `law_table`
    export_laws           files for spreadsheets, Abaqus, CalculiX and 4C           `export`

`of_patches` makes rows from contact problems of the whole surface, or of each patch alone,
`of_samples` from periodic samples of a large face; `refinement` asks them for more rows where the
error between rows is largest; `transmissivity` adds what leaks, by the flow through gaps of cells.
`exported_law` chooses rows with straight lines between, and makes a Python module of a law.
"""

FORMATS = ("csv", "4c", "abaqus", "calculix")
"""Names of the formats that laws are exported to."""
