"""Pairs of policies that differ in one value, each kept where Python can keep one. `make(name, drop)` lowers the root by
`drop` metres; nothing else differs."""

import collections
import dataclasses
import enum
import functools
import operator
import types
import weakref

import numpy

HERE = types.ModuleType("here")  # what a notebook's cell is: names that change between two calls


def lowered(observations, drop):
    plans = observations.hold()
    plans[:, :, 2] -= drop
    return plans


def cell(drop, text, name="policy", **names):
    """What `text` defines under `name`, as a cell of a notebook does; `DROP` stands for the value."""
    around = {"__name__": "__main__", "numpy": numpy, "functools": functools, **names}
    exec(text.replace("DROP", repr(drop)), around)
    return around[name]


def user_module(drop, text):
    module = types.ModuleType("my_helpers")
    exec(text.replace("DROP", repr(drop)), vars(module))
    return module


class Instance:
    def __init__(self, drop):
        self.drop = drop

    def __call__(self, observations):
        return lowered(observations, self.drop)

    def act(self, observations):
        return self(observations)


class Slotted:
    __slots__ = ("drop", "__weakref__")

    def __init__(self, drop):
        self.drop = drop

    def __call__(self, observations):
        return lowered(observations, self.drop)


class Inheriting(Instance):
    def __call__(self, observations):
        return super().__call__(observations)


class Array(Instance):
    def __init__(self, drop):
        self.drop = numpy.full(3, drop)

    def __call__(self, observations):
        return lowered(observations, self.drop[0])


class Weights:
    """A module as torch has them: its numbers are in tensors."""

    class Tensor:
        def __init__(self, numbers):
            self._numbers = numbers

        def detach(self):
            return self

        def cpu(self):
            return self

        def numpy(self):
            return self._numbers

    def __init__(self, drop):
        self.weight = self.Tensor(numpy.array([drop]))

    def state_dict(self):
        return collections.OrderedDict(weight=self.weight)

    def __call__(self, observations):
        return lowered(observations, self.weight.numpy()[0])


@dataclasses.dataclass
class Data:
    drop: float
    others: list = dataclasses.field(default_factory=list)

    def __call__(self, observations):
        return lowered(observations, self.drop)


@dataclasses.dataclass(frozen=True)
class Frozen:
    drop: float

    def __call__(self, observations):
        return lowered(observations, self.drop)


class Choice(enum.Enum):
    NONE = 0.0
    LOW = 0.2

    def __call__(self, observations):
        return lowered(observations, self.value)


class Named(collections.namedtuple("Named", "drop")):
    def __call__(self, observations):
        return lowered(observations, self.drop)


class Listed(list):
    def __call__(self, observations):
        return lowered(observations, self[0])


class Mapped(dict):
    def __call__(self, observations):
        return lowered(observations, self["drop"])


class Number(float):
    def __call__(self, observations):
        return lowered(observations, float(self))


class Holding:
    """Of anything that `read` finds the value in."""

    def __init__(self, held, read):
        self.held = held
        self.read = read

    def __call__(self, observations):
        return lowered(observations, self.read(self.held))


def with_self(drop):
    policy = Instance(drop)
    policy.me = policy
    return policy


def of_class(drop):
    return type("Made", (), {"drop": drop, "__call__": lambda self, o: lowered(o, self.drop)})()


def of_class_method(drop):
    class Made:
        value = drop

        @classmethod
        def act(cls, observations):
            return lowered(observations, cls.value)
    return Made.act


def of_static_method(drop):
    class Made:
        @staticmethod
        def act(observations, by=drop):
            return lowered(observations, by)
    return Made().act


def of_property(drop):
    class Made:
        by = property(lambda self: drop)

        def __call__(self, observations):
            return lowered(observations, self.by)
    return Made()


def of_base_class(drop):
    class Base:
        value = drop

    class Made(Base):
        def __call__(self, observations):
            return lowered(observations, self.value)
    return Made()


def of_meta_class(drop):
    class Meta(type):
        value = drop

    class Made(metaclass=Meta):
        def __call__(self, observations):
            return lowered(observations, type(type(self)).__getattribute__(type(self), "value"))
    return Made()


def closure(drop):
    def policy(observations):
        return lowered(observations, drop)
    return policy


def of_a_closure_of_a_closure(drop):
    def outer(observations):
        def inner():
            return drop
        return lowered(observations, inner())
    return outer


def decorated(drop):
    def lowers(function):
        @functools.wraps(function)
        def wrapper(observations):
            return lowered(observations, drop)
        return wrapper

    @lowers
    def policy(observations):
        return observations.hold()
    return policy


def wrapping(drop):
    def same(function):
        @functools.wraps(function)
        def wrapper(*arguments):
            return function(*arguments)
        return wrapper
    return same(closure(drop))


def of_default(drop):
    def policy(observations, by=drop):
        return lowered(observations, by)
    return policy


def of_keyword_default(drop):
    def policy(observations, *, by=drop):
        return lowered(observations, by)
    return policy


def of_function_attribute(drop):
    def policy(observations):
        return lowered(observations, policy.drop)
    policy.drop = drop
    return policy


def with_import(drop):
    """A module that the function imports while it is called."""
    import sys

    name = f"my_import_{str(drop).replace('.', '_')}"
    sys.modules[name] = user_module(drop, "GAIN = DROP")
    sys.modules[name].__name__ = "my_import"
    return cell(0.0, f"def policy(o):\n    import {name} as m\n    p = o.hold(); p[:, :, 2] -= m.GAIN\n    return p\n")


LOWER = "def policy(o):\n    p = o.hold()\n    p[:, :, 2] -= {}\n    return p\n"

PAIRS = {
    "attribute": Instance,
    "attribute of a base class": Inheriting,
    "slot": Slotted,
    "array": Array,
    "array of objects": lambda h: Holding(numpy.array([h, "x"], object), lambda held: held[0]),
    "structured array": lambda h: Holding(numpy.array([(h, 1)], [("by", "f8"), ("n", "i4")]), lambda held: held["by"][0]),
    "array that is a view": lambda h: Holding(numpy.array([[1.0, h], [2.0, h]])[:, 1], lambda held: held[0]),
    "NumPy's scalar": lambda h: Holding(numpy.float32(h), float),
    "NumPy's generator": lambda h: Holding(numpy.random.default_rng(int(h * 10)), lambda g: 0.2 * (
        g.bit_generator.state != numpy.random.default_rng(0).bit_generator.state)),
    "weights": Weights,
    "weights in an attribute": lambda h: Holding(Weights(h), lambda held: held.weight.numpy()[0]),
    "data class": Data,
    "frozen data class": Frozen,
    "member of an enum": Choice,
    "named tuple": Named,
    "list of its own kind": lambda h: Listed([h]),
    "dictionary of its own kind": lambda h: Mapped(drop=h),
    "number of its own kind": Number,
    "nested containers": lambda h: Holding({"a": [({"b": (1, h)},)]}, lambda held: held["a"][0][0]["b"][1]),
    "set": lambda h: Holding({1.0, h + 2.0}, lambda held: max(held) - 2.0),
    "deque": lambda h: Holding(collections.deque([h]), lambda held: held[0]),
    "default of a dictionary": lambda h: Holding(collections.defaultdict(h.__add__),
                                                 lambda held: held.default_factory(0.0)),
    "name space": lambda h: Holding(types.SimpleNamespace(by=h), lambda held: held.by),
    "weak reference": lambda h: (lambda kept: Holding((weakref.ref(kept), kept), lambda held: held[0]().drop))(Slotted(h)),
    "bytes": lambda h: Holding(bytearray([int(h * 10)]), lambda held: held[0] / 10),
    "object that holds itself": with_self,
    "attribute of a class": of_class,
    "attribute of a base class's body": of_base_class,
    "attribute of a meta class": of_meta_class,
    "class method": of_class_method,
    "static method": of_static_method,
    "property": of_property,
    "bound method": lambda h: Instance(h).act,
    "method of an object in an attribute": lambda h: Holding(Instance(h).act, lambda held: held.__self__.drop),
    "partial": lambda h: functools.partial(lowered, drop=h),
    "partial of a method": lambda h: functools.partial(Holding(None, lambda _: h).__call__),
    "closure": closure,
    "closure in a closure": of_a_closure_of_a_closure,
    "lambda": lambda h: lambda o: lowered(o, h),
    "lambdas in a list": lambda h: Holding([lambda: h], lambda held: held[0]()),
    "decorated": decorated,
    "wrapped": wrapping,
    "cached": lambda h: functools.lru_cache(closure(h)),
    "default": of_default,
    "keyword default": of_keyword_default,
    "attribute of a function": of_function_attribute,
    "edited constant": lambda h: cell(h, LOWER.format("DROP")),
    "edited constant of a nested function": lambda h: cell(h, "def policy(o):\n    by = lambda: DROP\n    p = o.hold()\n"
                                                              "    p[:, :, 2] -= by()\n    return p\n"),
    "edited constant of a method": lambda h: cell(h, "class P:\n    def __call__(self, o):\n        p = o.hold()\n"
                                                     "        p[:, :, 2] -= DROP\n        return p\npolicy = P()\n"),
    "edited tuple": lambda h: cell(h, LOWER.format("max((DROP, -1.0))")),
    "edited constant that is added": lambda h: cell(h, LOWER.replace("-= {}", "+= -DROP")),
    "global": lambda h: cell(h, "GAIN = DROP\n" + LOWER.format("GAIN")),
    "global array": lambda h: cell(h, "GAIN = numpy.array([DROP])\n" + LOWER.format("GAIN[0]")),
    "global of a function that is called": lambda h: cell(h, "GAIN = DROP\ndef by():\n    return GAIN\n" + LOWER.format("by()")),
    "global of a nested function": lambda h: cell(h, "GAIN = DROP\n" + LOWER.format("(lambda: GAIN)()")),
    "global object's attribute": lambda h: cell(h, LOWER.format("GAIN.drop"), GAIN=Instance(h)),
    "a module's value": lambda h: cell(h, LOWER.format("helpers.GAIN"), helpers=user_module(h, "GAIN = DROP")),
    "a module's function": lambda h: cell(h, LOWER.format("helpers.by()"), helpers=user_module(h, "def by():\n    return DROP")),
    "a module's function's global": lambda h: cell(h, LOWER.format("helpers.by()"), helpers=user_module(
        h, "GAIN = DROP\ndef by():\n    return GAIN")),
    "a module in an attribute": lambda h: Holding(user_module(h, "GAIN = DROP"), operator.attrgetter("GAIN")),
    "a module in a closure": lambda h: (lambda m: lambda o: lowered(o, m.GAIN))(user_module(h, "GAIN = DROP")),
    "imported while called": with_import,
}
