"""Instruments for physical parameters: steps, where they begin, and friction of differentiated rows."""
