"""The chain's TOML file: read, checked, and turned into a frozen ChainSpec."""
