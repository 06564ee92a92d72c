"""The computer's side of the robot's data link: reads points, writes parameters, keeps logs. It uses no clock."""
