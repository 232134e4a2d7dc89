"""The studies of the source paper, by public names of tensegra alone."""
