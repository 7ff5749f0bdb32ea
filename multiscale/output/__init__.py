"""What a run leaves behind and prints: tables, figures, report, fields, words."""
