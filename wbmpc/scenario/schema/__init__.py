"""The typed, strict schema of a scenario file: one module per group of blocks."""
