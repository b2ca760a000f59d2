"""Studio: interactive live simulation on a web page, with sliders for the scenario's
parameters.
"""
