"""tensegra: statics, uncertainty and optimisation of classical and clustered tensegrity structures."""
