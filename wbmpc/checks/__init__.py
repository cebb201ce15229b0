"""Checks of a run: each reads the recording and answers with a value against a threshold."""
