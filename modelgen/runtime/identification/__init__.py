"""identify(): records of a model to an estimate."""
