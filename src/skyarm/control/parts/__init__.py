"""Pieces that several laws share: filters, observers, inverse dynamics for an underactuated base."""
