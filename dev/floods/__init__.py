"""Floods: the robot in real time while clients write without end."""
