"""Reproduction of the paper's experiments: cases, published numbers, tables, report."""
