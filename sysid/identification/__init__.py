"""Identification of the appendix's tables 2 and 3 from bench recordings: in the paper's steps, and by joint fits."""
