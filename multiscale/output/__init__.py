"""What a run writes and prints: tables, figures, report, fields, lines in the terminal."""
