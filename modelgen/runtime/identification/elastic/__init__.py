"""Arms whose springs say where links or motors are."""
