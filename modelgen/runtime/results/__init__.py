"""The estimate, its checks, and their formats."""
