"""Times and memory of scoring, and of the models that are scored."""
