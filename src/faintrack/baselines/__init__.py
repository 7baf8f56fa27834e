"""Baselines: what track-before-detect is compared with."""
