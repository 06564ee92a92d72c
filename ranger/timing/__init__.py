"""Execution times of the robot: measured ones, and a static check of its schedules."""
