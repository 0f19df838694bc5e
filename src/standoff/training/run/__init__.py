"""A training run: loss, steps, validations, checkpoints, and the folder that it leaves."""
