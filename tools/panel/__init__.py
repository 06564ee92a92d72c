"""`ranger-sim panel`: RoboDAQ and the robot's front panel in a browser (README.md has the room's plan)."""
