"""Choose the views that matter, train scene models on them, and compare the ways of choosing."""

__version__ = "0.1.0"
