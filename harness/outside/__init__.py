"""A machine of which a part is outside: profiles, buses on interfaces, real boards, serial lines, slower schedules."""
