"""The generated module as the runtime reads it: the contract and its check."""
