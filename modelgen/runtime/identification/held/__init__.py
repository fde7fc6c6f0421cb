"""Machines that are held while they are recorded, by brakes or stops."""
