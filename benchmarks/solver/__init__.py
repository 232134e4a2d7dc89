"""How fast structures are solved, beside the machine's limit and other programs."""
