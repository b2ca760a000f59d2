"""Reproduction of Barakou et al. 2026 (Drones 10, 274): cases, published numbers, tables, report."""
