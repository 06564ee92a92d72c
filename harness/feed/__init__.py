"""The live feed of a running robot to programs of this machine: what its log would keep (FEED.md)."""
