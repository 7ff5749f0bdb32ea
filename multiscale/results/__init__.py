"""What a run found: load steps, values at mesh size zero with error bars, ranges of validity."""
