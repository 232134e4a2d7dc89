"""The chapters of a reproduction: a folder each, with a function of its name that makes it."""
