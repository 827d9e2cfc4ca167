"""How good a pose is: recordings with truth, error measures, reports."""
