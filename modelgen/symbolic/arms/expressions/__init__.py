"""Expressions with every node once: values in any ring, derivatives by rules."""
