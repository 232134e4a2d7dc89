"""The studio: a structure under one's hand, on a page."""
