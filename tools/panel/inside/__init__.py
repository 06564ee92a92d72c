"""The inside of a robot at a given time, running or recorded: slots of boards, load of buses, frames, errors."""
