"""Simulation: scans and samples drawn from the very sensors that the likelihoods evaluate."""
