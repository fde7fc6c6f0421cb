"""A model with numbers, in the formats of the tools that use them: each format is a file of its own."""
