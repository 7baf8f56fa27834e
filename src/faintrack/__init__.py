"""Detect and follow targets too quiet to threshold, from raw sensor data."""
