"""Gains from one recorded procedure."""
