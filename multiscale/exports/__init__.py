"""Writes patch laws in the forms that other programs read.

    LawSample, sample_law     rows between which straight lines hold        `sampling`
    places                    what patches and regions are called           `places`
    csv_text                  columns for spreadsheets                      `tables`
    abaqus_text, …            surface interactions of Abaqus, CalculiX      `keywords`
    law_modules               Python modules for 4C                         `law_module`

`export_laws` writes the files of one format.
"""

FORMATS = ("csv", "4c", "abaqus", "calculix")
"""Names of the formats."""
