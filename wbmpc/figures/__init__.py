"""Figures of a recording for pages and papers: a strip of key moments, and the curves that tell the run's story."""
