"""Writes patch laws in the forms that other programs read.

    LawSample, sample_law     rows between which straight lines hold        `sampling`
    csv_rows                  columns for spreadsheets                      `tables`
    abaqus_text, …            surface interactions of Abaqus, CalculiX      `keywords`
    law_module_text           a Python module for 4C                        `law_module`

`export_laws` writes the files of one format.
"""

FORMATS = ("csv", "4c", "abaqus", "calculix")
"""Names of the formats."""
