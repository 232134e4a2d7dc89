"""A small study, as its file would hold it."""

CONTENT = {
    "structure": "library:paper_beam",
    "seed": 1,
    "variables": {
        "A14": {"actuator": "A14", "distribution": {"uniform": [0.09, 0.10]}},
        "A23": {"actuator": "A23", "distribution": {"uniform": [0.07, 0.10]}},
    },
    "outputs": {"w": {"displacement": "z", "nodes": [18, 23]}, "T_K1": {"tension": "K1"}},
    "design": {"sampler": "sobol", "sizes": 64},
}


def set_at(content, path, value):
    """Set a value of nested mappings by its path of keys."""
    *keys, last = path.split(".")
    for key in keys:
        content = content[int(key)] if isinstance(content, list) else content[key]
    content[last] = value
