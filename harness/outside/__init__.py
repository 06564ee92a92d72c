"""A machine with a part outside: profiles, buses on interfaces, real boards, serial lines, slower schedules."""
