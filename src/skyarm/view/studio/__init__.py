"""The studio: a vehicle flown live on a page, with sliders for the numbers of its scenario."""
