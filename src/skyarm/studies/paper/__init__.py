"""Reproduction of Barakou et al. 2026 (Drones 10, 274): equations, cases, published numbers, tables and report."""
