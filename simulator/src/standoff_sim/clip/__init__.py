"""From the plan of a clip or a data set to its files."""
