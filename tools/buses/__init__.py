"""`ranger-sim bus`, `check-bus` and `can-bounds`: CAN buses without a robot, interfaces, and proven bounds."""
