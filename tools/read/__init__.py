"""`ranger-sim read`: what is in files of measured data, what became of every row, and what is odd about them."""
