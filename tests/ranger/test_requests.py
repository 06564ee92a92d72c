"""The supervisor's endpoint: what is admitted, what is answered with its fault, and how much a client may ask."""

import contextlib
import itertools
import json
import math
import socket

import pytest

from ranger_sim.can_bus.edge.peers import LIMITS
from ranger_sim.datatable import parameters
from ranger_sim.foundation.user_error import UserError
from ranger_sim.harness.processes.control import ControlServer, address
from ranger_sim.harness.testing.process_per_board import ProcessPerBoard
from ranger_sim.ranger.requests import Request, admitted
from ranger_sim.ranger.robot import Ranger

LIMIT = LIMITS["control"]


def line(**request):
    return json.dumps(request).encode()


def test_what_is_admitted_arrives_with_its_values_and_their_word():
    assert admitted(line(do="status")) == Request("status")
    assert admitted(line(do="key", key=5)) == Request("key", key=5)
    assert admitted(line(do="restart", board="MCH")) == Request("restart", board="MCH")
    # 500 in single precision is 0x43FA0000: 1.953125 x 2^8
    assert admitted(line(do="set", name="P_UI_LCD_TIME", value=500)) == Request(
        "set", name="P_UI_LCD_TIME", value=500.0, word=0x43FA0000
    )


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (b"[" * 60_000, "one line with a JSON object"),
        (b'{"do":' * 30_000, "one line with a JSON object"),
        (b"", "one line with a JSON object"),
        (b"[]", "one line with a JSON object"),
        (b"\xff\xfe", "one line with a JSON object"),
        (b'{"do": ' + b"9" * 5000 + b"}", "one line with a JSON object"),
        (b'{"do": "status", "do": "pause"}', "'do' comes twice in one object"),
        (b'{"do": "set", "name": "P_UI_LCD_TIME", "value": NaN}', "NaN is not a finite number"),
        (b'{"do": "set", "name": "P_UI_LCD_TIME", "value": -Infinity}', "-Infinity is not a finite number"),
        (b'{"do": "set", "name": "P_UI_LCD_TIME", "value": 1e999}', "1e999 is not a finite number"),
        (line(), "None is not a request"),
        (line(do=["status"]), "['status'] is not a request"),
        (line(do="stop"), "'stop' is not a request"),
        (line(do="status", extra=1), "unknown field 'extra' (available: none)"),
        (line(do="key"), "key is missing"),
        *[(line(do="key", key=key), "is not 0 to 5") for key in ("abc", None, 1.5, 10**20, -1, 6, True, [1], {})],
        (line(do="set", name="P_UI_LCD_TIME", value={}), "P_UI_LCD_TIME = {}: a number is expected"),
        (line(do="set", name="P_UI_LCD_TIME", value=[1]), "P_UI_LCD_TIME = [1]: a number is expected"),
        (line(do="set", name="P_UI_LCD_TIME", value=True), "P_UI_LCD_TIME = True: a number is expected"),
        (line(do="set", name="P_UI_LCD_TIME", value=10**400), "a number is expected"),
        (line(do="set", name="P_UI_LCD_TIME", value=99.9), "P_UI_LCD_TIME = 99.9 is outside 100 to 60000 ms"),
        (line(do="set", name="P_UI_LCD_TIME", value=60001), "P_UI_LCD_TIME = 60001 is outside 100 to 60000 ms"),
        (line(do="set", name="MCH_ANGLE", value=1), "MCH_ANGLE: not a parameter, it is published by MCH"),
        (line(do="set", name="LV_CH_0", value=1), "LV_CH_0: not a parameter"),
        (line(do="set", name="P_UI_LCD_TIM", value=1), "unknown variable 'P_UI_LCD_TIM'; did you mean 'P_UI_LCD_TIME'"),
        (line(do="set", name="\x1b[2J", value=1), "unknown variable '\\x1b[2J'"),
        (line(do="set", name={}, value=1), "{} is not the name of a parameter"),
        (line(do="restart", board="plant"), "'plant' is none of MCH"),
        (line(do="restart", board=["MCH"]), "['MCH'] is none of MCH"),
    ],
)
def test_what_is_not_admitted_is_one_line_that_names_the_fault(text, words):
    with pytest.raises(UserError) as fault:
        admitted(text)
    assert words in str(fault.value) and str(fault.value).isprintable() and len(str(fault.value)) < 200


def test_every_parameters_own_limits_are_admitted_and_the_next_number_beyond_is_not():
    """Both ends of every row that has them, against the file itself."""
    checked = 0
    for row in parameters.parameters():
        for bound, beyond in ((row.minimum, -math.inf), (row.maximum, math.inf)):
            if bound is None:
                continue
            parameters.checked_word(row, bound)
            with pytest.raises(UserError, match=f"{row.name} = .* is outside"):
                parameters.checked_word(row, math.nextafter(bound, beyond))
            checked += 1
    assert checked > 100


@pytest.mark.parametrize("kind", [Ranger, lambda: Ranger(mode=ProcessPerBoard())])
def test_python_writes_a_parameter_by_the_same_check(kind):
    with contextlib.closing(kind()) as robot:
        robot.run_for(0.01)
        for name, value, fault in (
            ("P_UI_LCD_TIME", 5, "P_UI_LCD_TIME = 5 is outside 100 to 60000 ms"),
            ("P_UI_LCD_TIME", math.nan, "P_UI_LCD_TIME = nan: a number is expected"),
            ("P_UI_LCD_TIME", None, "P_UI_LCD_TIME = None: a number is expected"),
            ("MCH_ANGLE", 1.0, "MCH_ANGLE: not a parameter, it is published by MCH"),
        ):
            with pytest.raises(UserError, match=fault):
                robot.set_parameter(name, value)
        before = robot.variable("P_UI_LCD_TIME")
        robot.set_parameter("P_UI_LCD_TIME", 500)
        robot.run_for(0.01)
        assert (before, robot.variable("P_UI_LCD_TIME")) == (4000.0, 500.0)


class Robot:
    """An endpoint and what passed it; answers each request at once, unless `silent`."""

    def __init__(self, name):
        self.requests = []
        self.silent = False
        self.server = ControlServer(name, admitted, self.obey)

    def obey(self, number, request):
        self.requests.append((number, request))
        if not self.silent:
            self.server.answer(number, {"did": request.do})


@pytest.fixture
def robot(request):
    each = Robot(f"requests-{id(request)}")
    each.clients = []

    def connect():
        client = socket.socket(socket.AF_UNIX, socket.SOCK_STREAM)
        client.connect(each.server.listener.getsockname())
        client.setblocking(False)
        each.clients.append(client)
        return client

    each.connect = connect
    yield each
    each.server.close()
    for client in each.clients:
        client.close()


def answers(client):
    try:
        return [json.loads(text) for text in client.recv(1 << 20).splitlines()]
    except BlockingIOError:
        return []


def test_every_request_of_a_packet_is_answered_in_its_order(robot):
    client = robot.connect()
    client.send(b'{"do": "pause"}\nnonsense\n{"do": "key", "key": 9}\n{"do": "resume"}\n')
    robot.server.poll()
    first, second, third, fourth = answers(client)
    assert (first, fourth) == ({"did": "pause"}, {"did": "resume"})
    assert "JSON object" in second["error"] and "9 is not 0 to 5" in third["error"]
    assert robot.server.counters()["not_admitted"] == 2


def test_the_next_request_waits_for_the_answer_to_the_one_before(robot):
    client = robot.connect()
    robot.silent = True
    client.send(b'{"do": "pause"}\n{"do": "resume"}\n')
    robot.server.poll()
    robot.server.poll()
    ((number, _),) = robot.requests
    robot.server.answer(number, {"done": 1})
    robot.server.poll()
    assert answers(client) == [{"done": 1}] and [each.do for _, each in robot.requests] == ["pause", "resume"]


def test_an_answer_for_a_client_that_left_reaches_no_other_client(robot):
    robot.silent = True
    gone = robot.connect()
    gone.send(b'{"do": "pause"}\n')
    robot.server.poll()
    gone.close()
    other = robot.connect()
    robot.server.poll()
    robot.server.answer(robot.requests[0][0], {"done": 1})
    robot.server.poll()
    assert answers(other) == []


def test_a_thousand_silent_connections_leave_a_place_for_one_that_asks(robot):
    """1011 of them at 1024 descriptors ended a run: the review of 22 November 2026, R3."""
    seconds = itertools.count()
    robot.server.clock = lambda: float(next(seconds))  # time enough for all who knock
    for _ in range(1011):
        robot.connect()
        robot.server.poll()
        assert len(robot.server.peers) <= LIMIT.peers
    client = robot.connect()
    client.send(b'{"do": "status"}\n')
    robot.server.poll()
    assert answers(client) == [{"did": "status"}]
    assert robot.server.sent_away["idle"] == 1012 - LIMIT.peers


def test_a_poll_carries_out_no_more_than_its_share_however_much_has_arrived(robot):
    clients = [robot.connect() for _ in range(3)]
    for _ in clients:
        robot.server.poll()
    for client in clients:
        client.send(b'{"do": "status"}\n' * 200)
    for look in range(1, 5):
        robot.server.poll()
        assert len(robot.requests) == look * LIMIT.burst
    shares = [sum(number == each for number, _ in robot.requests) for each in (1, 2, 3)]
    assert max(shares) - min(shares) <= 4  # one of each in turn; the turn passes on with every look


def test_a_client_with_an_endless_line_gets_the_limit_and_is_closed(robot):
    client = robot.connect()
    client.send(b"x" * LIMIT.longest)
    robot.server.poll()
    robot.server.poll()
    ((answer),) = answers(client)
    assert answer == {"error": "this client sent a request above the limit"}
    assert client.recv(1) == b"" and robot.server.sent_away["too_long"] == 1


def test_a_second_robot_of_a_name_is_reported(robot):
    name = robot.server.listener.getsockname()[1:].decode().rpartition("/")[2]
    assert address(name).endswith(name)
    with pytest.raises(UserError, match=f"a robot named {name} is already running"):
        ControlServer(name, admitted, robot.obey)


def test_requests_of_a_client_that_left_without_its_answers_are_carried_out_for_two_seconds_only(robot):
    now_s = [100.0]
    robot.server.clock = lambda: now_s[0]
    client = robot.connect()
    sent = client.send((line(do="status") + b"\n") * 5000) // len(line(do="status") + b"\n")
    client.close()
    for _ in range(5):
        robot.server.poll()
    done = len(robot.requests)
    assert 4 * LIMIT.burst <= done < sent and len(robot.server.peers) == 1
    now_s[0] += 1.9
    robot.server.poll()
    assert len(robot.requests) > done
    now_s[0] += 0.2
    robot.server.poll()
    assert not robot.server.peers and not robot.server.clients and robot.server.sent_away["stalled"] == 1
