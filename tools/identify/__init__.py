"""`ranger-sim identify`: the appendix's tables 2 and 3 from bench recordings, virtual or a user's own."""
