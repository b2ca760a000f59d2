"""Frozen dataclasses of numbers: traversal, checks, digests, and conversion to and from
plain data.
"""
