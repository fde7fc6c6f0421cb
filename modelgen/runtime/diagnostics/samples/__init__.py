"""What looks wrong in the samples of a record, and records without it."""
