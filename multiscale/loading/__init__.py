"""Load histories, and the stepper that turns them into load steps of any coupling."""
