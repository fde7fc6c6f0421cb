"""Sensor sets and other estimators side by side."""
