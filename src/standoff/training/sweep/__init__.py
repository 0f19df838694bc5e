"""Several plans on one data set: scenarios of settings, one run each, and one table of all."""
