"""Curves drawn with matplotlib (extra `plot`), into axes that are given or new ones."""
