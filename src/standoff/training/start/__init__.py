"""The network that a run starts from: anchors from the data, parameters from weights that somebody trained."""
