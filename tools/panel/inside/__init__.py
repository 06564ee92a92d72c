"""What is inside a robot at an instant, running or recorded: slots of boards, load of buses, frames, errors."""
