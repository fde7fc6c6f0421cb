"""What a command prints, as an HTML page."""
