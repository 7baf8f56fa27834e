"""Targets: what their state is, how they move, where and how often they appear and leave."""
