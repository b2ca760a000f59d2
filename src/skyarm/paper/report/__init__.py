"""The report of the paper's reproduction."""
