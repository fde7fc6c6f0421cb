"""A project file: what is identified from what, how, again and again; and the history of what came of it."""
