"""What a run leaves behind and says: tables, figures, report, words."""
