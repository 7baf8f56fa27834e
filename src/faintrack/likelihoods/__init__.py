"""Likelihoods: a scan and states in, the log ratio of target against no target out."""
