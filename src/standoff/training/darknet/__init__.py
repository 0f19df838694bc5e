"""Darknet's files: cfg and weights in and out, the network they describe, its export to ONNX."""
