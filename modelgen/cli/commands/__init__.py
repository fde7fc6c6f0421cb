"""The commands, one a file; `modelgen.cli.main` gathers them."""
