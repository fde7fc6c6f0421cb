"""Everything that works on data: NumPy and SciPy only, no computer algebra, no templates.

Record -> Observation -> Estimate -> Comparison -> report. The generated module declares which signals it
needs (`contract`); this package decides how to get them from what the sensors read (`data`, `filters`).
"""
