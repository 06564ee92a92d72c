"""The only package that connects the emulated buses to other CAN software: python-can messages and candump logs; and
the limits of every program that connects (peers.py)."""
