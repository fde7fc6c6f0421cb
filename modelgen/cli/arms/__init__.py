"""Arms on the command line: what is printed of them."""
