"""Checks of a record and of a fit: motion, noise, residuals, periods, held-out records."""
