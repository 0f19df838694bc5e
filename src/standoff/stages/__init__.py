"""The pipeline, one folder for each arrow; siblings never import each other."""
