"""`modelgen run` and `modelgen new --project`: project files on the command line."""
