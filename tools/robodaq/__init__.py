"""The computer's side of the robot's data link: reads points, writes parameters, keeps logs. No clock of its own."""
