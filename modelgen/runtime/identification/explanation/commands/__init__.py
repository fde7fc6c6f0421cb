"""Commands that a drive holds: what acts between samples, and what sampling makes of it."""
