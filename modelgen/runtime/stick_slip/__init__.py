"""Exact motion of a chain with Coulomb friction, from event to event."""
