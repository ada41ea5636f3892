"""Probes that try to answer questions without comparing shapes: fixed rules, trees, a network."""
