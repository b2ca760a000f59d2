"""Automatic gain tuning by one recorded procedure."""
