"""The command line: one file a command; the only place where the derivation and the estimation meet."""
