"""`ranger-sim new`: a project for a machine of one's own. What it writes are the `.j2` files beside this one."""
