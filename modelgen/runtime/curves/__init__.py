"""What is drawn, as numbers: the report's SVG and matplotlib draw the same curves."""
