"""A running robot shown whole to programs of this machine: what its log would keep, as it happens (FEED.md)."""
