"""What a generated module may consist of: checked before it is written, and before it is executed."""
