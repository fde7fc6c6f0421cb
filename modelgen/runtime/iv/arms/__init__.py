"""Instruments of arms."""
