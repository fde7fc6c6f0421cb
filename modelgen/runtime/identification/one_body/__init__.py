"""A chain of which slow motion shows no spring, as one body."""
