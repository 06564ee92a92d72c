"""`ranger-sim panel`: RoboDAQ and the robot's front panel in a browser (README.md has the package's design)."""
