"""Pages that are one file and need nothing else: a plain look for tables and pictures, light and dark."""

from skyarm.pages.html_page import details, grouped, image, page, section, table

__all__ = ["details", "grouped", "image", "page", "section", "table"]
