"""What a chain does under measured forces: simulated in open loop, or predicted some samples ahead."""
