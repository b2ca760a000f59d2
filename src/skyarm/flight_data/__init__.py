"""Measured flights: files of real flights, read as time series in SI units and in
skyarm's coordinate axes.
"""
