"""File formats whose libraries a damaged file can crash: they are read in a process of their own."""
