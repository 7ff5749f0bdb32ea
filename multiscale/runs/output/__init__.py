"""What a run writes: tables, figures, report, fields, checkpoint; its folder."""
