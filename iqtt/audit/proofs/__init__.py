"""Proofs that questions are right, each recomputed from the file with code of the audit's own."""
