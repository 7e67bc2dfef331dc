"""Agents that the tests fly: each does one thing that is looked at."""

import contextlib
import signal
import sys


@contextlib.contextmanager
def raises(kind, words):
    """The block raises an exception that says these words."""
    try:
        yield
    except kind as error:
        assert words in str(error), error
    else:
        raise AssertionError("it was accepted")


class Failing:
    def __init__(self, id):
        self.id = id

    def telemetry(self, telemetry, cx):
        if self.id == 1:
            raise ValueError("on purpose")
        cx.land()


class Deep(Failing):
    """Fails 30 calls deep, with a cause."""

    def telemetry(self, telemetry, cx):
        self.odd(30) if self.id == 1 else cx.land()

    def odd(self, calls):
        self.even(calls - 1)

    def even(self, calls):
        if calls > 0:
            self.odd(calls - 1)
        try:
            {}["a cause"]
        except KeyError as error:
            raise ValueError("on purpose") from error


class Addressed(Failing):
    """Fails with an address in memory, another each time."""

    objects = []

    def telemetry(self, telemetry, cx):
        if self.id == 1:
            self.objects.append(object())
            raise ValueError(f"bad {self.objects[-1]}")
        cx.land()


class Greedy:
    """Asks for as much as it gets."""

    def __init__(self, id):
        pass

    def start(self, cx):
        messages = timers = 0
        try:
            while messages < 100:
                cx.send("all", b"x")
                messages += 1
        except ValueError as error:
            assert str(error) == "an agent may send at most 64 messages in one call", error
        try:
            while timers < 100:
                cx.set_timer(timers, 60)
                cx.set_timer(timers, 50)
                timers += 1
        except ValueError as error:
            assert "at most 64" in str(error), error
        cx.observe("messages", messages)
        cx.observe("timers", timers)

    def telemetry(self, telemetry, cx):
        try:
            cx.set_timer(100, 1)
        except ValueError:
            cx.cancel_timer(5)
            cx.set_timer(100, 1)
            cx.send("all", b"again")
            cx.observe("replaced", 1)
            cx.land()


class Brittle:
    """Can't be built again."""

    built = set()

    def __init__(self, id):
        if id == 1 and id in self.built:
            raise ValueError("only once")
        self.built.add(id)

    def telemetry(self, telemetry, cx):
        if cx.id == 1:
            raise ValueError("on purpose")
        cx.land()


class Keeping:
    """Keeps a context beyond its call."""

    def __init__(self, id):
        pass

    def start(self, cx):
        self.cx = cx

    def telemetry(self, telemetry, cx):
        commands = [
            lambda: self.cx.go_to((0, 0, 10)), lambda: self.cx.track((0, 0, 10), (0, 0, 0)), self.cx.hold, self.cx.land,
            lambda: self.cx.send("all", b"x"), lambda: self.cx.set_timer(1, 1), lambda: self.cx.cancel_timer(1),
            lambda: self.cx.set_telemetry(1), lambda: self.cx.keep(b"x"), lambda: self.cx.observe("x", 1),
        ]
        for command in commands:
            with raises(RuntimeError, "belongs to an earlier call"):
                command()
        assert self.cx.id == cx.id
        cx.observe("refused", len(commands))
        cx.land()


class Interrupting:
    """Presses Ctrl-C in flight."""

    def __init__(self, id):
        pass

    def telemetry(self, telemetry, cx):
        if cx.id == 1:
            signal.raise_signal(signal.SIGINT)


class Exiting(Interrupting):
    def start(self, cx):
        if cx.id == 1:
            sys.exit("enough")


class Endless:
    """Flies until its time is over."""

    def __init__(self, id):
        pass

    def telemetry(self, telemetry, cx):
        pass


class Dice:
    """Flies to places drawn at random, and lands at the fifth."""

    def __init__(self, id):
        self.places = 0

    def start(self, cx):
        assert cx.parameters == {"side_m": 40}
        self.next(cx)

    def next(self, cx):
        north, east, altitude = cx.slot
        cx.go_to((north + cx.rng.uniform(0, 40), east, altitude))

    def telemetry(self, telemetry, cx):
        if telemetry.has_arrived:
            self.places += 1
            cx.land() if self.places == 5 else self.next(cx)


class Sending:
    """Learns why a message was dropped."""

    def __init__(self, id):
        pass

    def start(self, cx):
        assert cx.altitude_max_m > 10
        cx.send(99, b"x", acknowledged=True)

    def swarm(self, event, cx):
        if event.kind == "message_dropped":
            assert "drone" in event.reason, event.reason
            cx.observe("dropped", 1)
            cx.land()
        else:
            assert event.reason is None


class Talking:
    """Drone 0 tells all its neighbours something, again and again, until a long message has arrived."""

    def __init__(self, id):
        self.id = id

    def start(self, cx):
        cx.set_timer(1, 0.1 if self.id == 0 else 300)
        if self.id == 0:
            self.long, self.sent, self.is_over = cx.send(4, bytes(1 << 20), acknowledged=True), 0, False

    def timer(self, timer, cx):
        if self.id or self.is_over:
            return cx.land()
        for _ in range(8):
            cx.send("neighbours", b"x")
            self.sent += 1
        cx.set_timer(1, 0.25)

    def swarm(self, event, cx):
        if event.kind == "message_delivered":
            assert event.message == self.long, event.message
            cx.observe("sent meanwhile", self.sent)
            self.is_over = True
