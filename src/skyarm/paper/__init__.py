"""The paper's experiments: cases, published numbers, tables, report."""
