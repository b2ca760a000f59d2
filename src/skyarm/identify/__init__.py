"""System identification: vehicle models from flight logs, fitted by simulating short
windows of the flights.
"""
