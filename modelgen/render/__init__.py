"""From a BaseModel to the text of a module: strings and tuples, a template, a file."""
