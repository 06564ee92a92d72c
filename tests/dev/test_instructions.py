"""Instructions by module, from a file as callgrind writes it."""

from dev import instructions

FILE = """\
version: 1
positions: line
events: Ir
summary: 1000

ob=(1) /home/x/build/compiled/cpython-311/ranger_sim/can_bus/bus.cpython-311-x86_64-linux-gnu.so
fl=(1) bus.c
fn=(1) pass_time
10 100
+2 20
cob=(2) /usr/lib/x86_64-linux-gnu/libm.so.6
cfi=(2) ???
cfn=(2) sin
calls=3 0
* 600
* 5

ob=(2)
fn=(2)
0 300

fn=(3) cos
0 44
ob=(3) /home/x/.venv/bin/python3.11
fn=(4) eval
7 31
"""


def test_what_a_function_calls_counts_where_it_is_and_not_for_the_caller():
    by_object = instructions.by_object(FILE)
    assert {instructions.module_of(path): count for path, count in by_object.items()} == {
        "can_bus.bus": 100 + 20 + 5,
        "(C library)": 300 + 44,
        "(CPython)": 31,
    }


def test_the_table_has_the_most_first_and_the_sum_of_all():
    lines = instructions.table({"can_bus": 1e6, "plant": 3e6, "tools": 0.0}, 2).splitlines()
    assert lines[2:] == ["| plant | 3.0 | 75.0% |", "| can_bus | 1.0 | 25.0% |", "| in all | 4.0 | |"]
