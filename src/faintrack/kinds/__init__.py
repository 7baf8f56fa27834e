"""Kinds of data, one room each."""
