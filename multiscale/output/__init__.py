"""What a run writes and prints: tables, figures, report, fields, checkpoint, lines; its folder."""
