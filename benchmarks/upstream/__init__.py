"""Minimal examples of faults in libraries, for reports to their authors."""
