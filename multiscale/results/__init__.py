"""What a run finds: its history, the record of a reference, notes on validity."""
