"""Benchmarks: how fast and how exact tensegra is; README.md says what each one measures."""
