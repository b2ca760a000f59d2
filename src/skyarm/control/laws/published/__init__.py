"""Laws of other authors, one per file: those that Barakou et al. 2026 cite, and two
newer ones (INDI, L1).
"""
