"""Arithmetic that is ours: random numbers, sines and angles, products of matrices in full precision."""
