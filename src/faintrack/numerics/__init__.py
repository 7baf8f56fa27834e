"""Arithmetic that is ours: random numbers, sines and angles, full precision; and where compiled programs are kept."""
