"""`modelgen demo`: the tables and figures of the paper, from a bench simulated with its values."""
