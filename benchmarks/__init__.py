"""Measurements: never part of the tests, for their answers depend on the machine or take minutes."""
