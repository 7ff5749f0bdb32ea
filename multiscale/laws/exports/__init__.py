"""Writes patch laws in the forms that other programs read.

places, sample_law        where laws hold, rows with straight lines between     `sampling`
keyword_text              surface interactions of Abaqus, CalculiX              `keywords`
law_modules               Python modules for 4C                                 `law_module`
laws_csv, export_laws     columns for spreadsheets; the files of one format     `export`
"""

FORMATS = ("csv", "4c", "abaqus", "calculix")
"""Names of the formats."""
