"""Visualisation of flights: figures, films, recordings and the live page, from one
common scene.
"""
