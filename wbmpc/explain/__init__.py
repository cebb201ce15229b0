"""A recorded plan solved again, and what it was made of: terms, active constraints, multipliers, candidates."""
