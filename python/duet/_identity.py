"""What a policy of Python is, as one SHA-256: its code and the data that it holds.

Code is bytecode with its constants: comments and the place of a file do not matter. Data is what the code can reach:
attributes, slots, closure cells, defaults, the globals that it names, arrays and weights by content. Modules of the
standard library count by name, packages of site-packages by their files, all others as the policy's own code. What
shows no state (an open file, a socket, a C object that cannot be pickled) is refused with a sentence that asks for
`version`, and so is code that reads files or talks to others while it is called.
"""

from __future__ import annotations

import builtins
import enum
import functools
import glob
import hashlib
import logging
import os
import re
import struct
import sys
import types
from typing import Any, Dict, FrozenSet, Iterable, List, NamedTuple, Optional, Set, Tuple

_PLAIN: Dict[type, Any] = {
    type(None): lambda value: b"", bool: lambda value: b"%d" % value, int: lambda value: b"%x" % value if value >= 0 else b"-%x" % -value,
    float: lambda value: struct.pack("<d", value), complex: lambda value: struct.pack("<dd", value.real, value.imag),
    str: lambda value: value.encode("utf-8", "surrogatepass"), bytes: bytes, bytearray: bytes,
    type(...): lambda value: b"", type(NotImplemented): lambda value: b""}
_NAMED_IN_C = (types.BuiltinFunctionType, types.MethodWrapperType, types.WrapperDescriptorType, types.MethodDescriptorType,
               types.ClassMethodDescriptorType, types.GetSetDescriptorType, types.MemberDescriptorType)
_LOCKS = (type(__import__("_thread").allocate_lock()), type(__import__("_thread").RLock()))
# Entries of a class that say nothing of what its instances do.
_NOT_OF_A_CLASS = frozenset((
    "__dict__", "__weakref__", "__module__", "__doc__", "__annotations__", "__annotate__", "__annotate_func__", "__annotations_cache__",
    "__qualname__", "__dataclass_fields__", "__dataclass_params__", "__match_args__", "__abstractmethods__", "_abc_impl", "__parameters__",
    "__orig_bases__", "__firstlineno__", "__static_attributes__", "__slots__", "__slotnames__", "__classcell__"))
# Methods that have done their work before a policy is called.
_BEFORE_CALLS = frozenset(("__init__", "__new__", "__post_init__", "__init_subclass__", "__set_name__", "__del__", "__setstate__",
                           "__getstate__", "__reduce__", "__reduce_ex__", "__copy__", "__deepcopy__", "__repr__", "__str__"))
# Names by which code reads what is neither in it nor in what it holds.
_READS = frozenset((
    "builtins.open", "builtins.input", "builtins.eval", "builtins.exec", "builtins.globals", "builtins.__import__", "io.open",
    "os.environ", "os.environb", "os.getenv", "os.getenvb", "os.open", "os.popen", "os.system", "numpy.load", "numpy.loadtxt",
    "numpy.genfromtxt", "numpy.fromfile", "numpy.memmap", "torch.load", "importlib.import_module", "importlib.reload"))
_READING_METHODS = frozenset(("read_text", "read_bytes", "recv", "recvfrom", "recv_into", "urlopen"))
_TALKING_MODULES = frozenset(("socket", "subprocess", "urllib", "http", "requests", "zmq", "grpc", "websocket", "websockets", "ctypes"))
_MANY_FILES = 400  # of a package: from here on its list of files speaks for them


class _Names(NamedTuple):
    """What a code object, with the code in it, names."""

    globals: FrozenSet[str]
    all: FrozenSet[str]  # attributes and variables of functions around it too
    imports: Tuple[Tuple[str, int], ...]  # module and level


@functools.lru_cache(maxsize=4096)
def _names_of(code: types.CodeType) -> _Names:
    import dis

    named: Set[str] = set()
    every: Set[str] = set(code.co_names) | set(code.co_freevars)
    imports: List[Tuple[str, int]] = []
    level = 0
    previous: List[Any] = []
    for step in dis.get_instructions(code):
        if step.opname in ("LOAD_GLOBAL", "LOAD_NAME", "LOAD_FROM_DICT_OR_GLOBALS"):
            named.add(step.argval)
        if step.opname == "IMPORT_NAME":  # after the level and the names
            level = next((back.argval for back in previous[-2:] if isinstance(back.argval, int)), 0)
            imports.append((step.argval, level))
        previous.append(step)
    for constant in code.co_consts:
        if isinstance(constant, types.CodeType):
            inner = _names_of(constant)
            named |= inner.globals
            every |= inner.all
            imports += inner.imports
    return _Names(frozenset(named), frozenset(every), tuple(imports))


def _constant_text(value: Any) -> str:
    if isinstance(value, types.CodeType):
        return _code_digest(value)
    if isinstance(value, tuple):
        return f"({','.join(map(_constant_text, value))})"
    if isinstance(value, frozenset):
        return f"{{{','.join(sorted(map(_constant_text, value)))}}}"
    return f"{type(value).__name__} {value!r}"


@functools.lru_cache(maxsize=4096)
def _code_digest(code: types.CodeType) -> str:
    said = (code.co_name, code.co_argcount, code.co_posonlyargcount, code.co_kwonlyargcount, code.co_flags, code.co_names,
            code.co_varnames, code.co_freevars, code.co_cellvars, code.co_code, getattr(code, "co_exceptiontable", b""))
    return hashlib.sha256(f"{said!r}{_constant_text(code.co_consts)}".encode("utf-8", "surrogatepass")).hexdigest()


@functools.lru_cache(maxsize=None)
def _standard_folders() -> Tuple[str, ...]:
    import sysconfig

    paths = sysconfig.get_paths()
    return tuple(os.path.realpath(paths[name]) + os.sep for name in ("stdlib", "platstdlib"))


class _Home(NamedTuple):
    """Where code comes from."""

    kind: str  # "own", "package" or "standard"
    digest: str


_OWN, _STANDARD = _Home("own", ""), _Home("standard", "")


def _home_of(name: str, file: Optional[str]) -> _Home:
    top = name.partition(".")[0]
    if top == "duet" or top in sys.builtin_module_names:
        return _STANDARD
    if name == "__main__" or not isinstance(file, str):
        return _STANDARD if file is None and top in getattr(sys, "stdlib_module_names", ()) else _OWN
    parts = os.path.realpath(file).split(os.sep)
    for folder in ("site-packages", "dist-packages"):
        if folder in parts:
            return _Home("package", _package_digest(os.sep.join(parts[:parts.index(folder) + 1]), parts[parts.index(folder) + 1]))
    return _STANDARD if os.path.realpath(file).startswith(_standard_folders()) else _OWN


@functools.lru_cache(maxsize=None)
def _package_digest(folder: str, top: str) -> str:
    """Of the files of an installed package, of their list where they are many."""
    path = os.path.join(folder, top)
    files = [path] if os.path.isfile(path) else sorted(
        file for ending in ("py", "so", "pyd") for file in glob.glob(os.path.join(glob.escape(path), "**", f"*.{ending}"), recursive=True))
    if len(files) > _MANY_FILES:
        version = getattr(sys.modules.get(top), "__version__", "")
        files = sorted(glob.glob(os.path.join(glob.escape(folder), f"{glob.escape(top)}-*.dist-info", "RECORD")))
    else:
        version = ""
    digest = hashlib.sha256(f"{version}\n".encode())
    for file in files:
        with open(file, "rb") as stream:
            digest.update(f"{os.path.relpath(file, folder)}\n".encode() + hashlib.sha256(stream.read()).digest())
    return digest.hexdigest()


def forget_packages() -> None:
    """They may have been installed anew since they were looked at."""
    _package_digest.cache_clear()


def _module_home(module: types.ModuleType) -> _Home:
    return _home_of(module.__name__, getattr(module, "__file__", None))


def _is_found_by_name(value: Any) -> bool:
    """Whether its module has it under its name: not so for what a call has made."""
    found: Any = sys.modules.get(getattr(value, "__module__", None) or "")
    for part in getattr(value, "__qualname__", "<locals>").split("."):
        found = getattr(found, part, None)
    return found is value


def _class_home(kind: type) -> _Home:
    if kind.__module__ == "builtins" or not _is_found_by_name(kind):
        return _STANDARD if kind.__module__ == "builtins" else _OWN
    return _module_home(sys.modules[kind.__module__])


def _slots_of(kind: type) -> List[Tuple[str, Any]]:
    return [(name, member) for base in reversed(kind.__mro__) if "__slots__" in vars(base)
            for name, member in sorted(vars(base).items()) if isinstance(member, types.MemberDescriptorType)]


def _hides_state(value: Any) -> bool:
    """Whether C keeps more of it than its __dict__ and slots."""
    kind = type(value)
    known = object.__basicsize__ + 8 * (len(_slots_of(kind)) + (getattr(kind, "__dictoffset__", 0) > 0) +
                                        (getattr(kind, "__weakrefoffset__", 0) > 0))
    return kind.__itemsize__ != 0 or kind.__basicsize__ > known


class _Live(NamedTuple):
    """A function that was met: the names by which it is reached, what it names, and what it reads from outside."""

    reached_as: Set[str]
    names: FrozenSet[str]
    reads: List[str]


class _Walk:
    """Goes through code and data; `data`: else through the data for the code that is in it alone."""

    def __init__(self, data: bool):
        self._data = data
        self._hash = hashlib.sha256()
        self._codes: Set[str] = set()
        self._seen: Dict[int, int] = {}
        self._kept: List[Any] = []  # an id tells an object from others as long as it lives
        self._members: Set[Tuple[int, str]] = set()  # of modules
        self._functions: Dict[int, _Live] = {}
        self._in_weights = False
        self.unknown: List[str] = []

    def digest(self) -> str:
        for code in sorted(self._codes):
            self._hash.update(code.encode())
        return self._hash.hexdigest()

    def read_outside(self) -> List[str]:
        """What code reads while it is called, as far as names tell which code is."""
        live: Set[str] = set()
        waiting = dict(self._functions)
        reads: List[str] = []
        while True:
            reached = [key for key, one in waiting.items()
                       if any(name in live or name == "" or (name.startswith("__") and name not in _BEFORE_CALLS)
                              for name in one.reached_as)]
            if not reached:
                return reads
            for key in reached:
                one = waiting.pop(key)
                live |= one.names
                reads += one.reads

    def walk(self, value: Any, path: str) -> None:
        plain = _PLAIN.get(type(value))
        if plain is not None:
            self._put(type(value).__name__, plain(value))
        elif type(value) is tuple:
            self._items("tuple", value, path)
        elif isinstance(value, types.ModuleType):
            self._module(value, None, path)
        elif id(value) in self._seen:
            if id(value) in self._functions:
                self._functions[id(value)].reached_as.add(_last_name(path))
            self._put("again", b"%d" % self._seen[id(value)])
        else:
            self._seen[id(value)] = len(self._seen)
            self._kept.append(value)
            self._object(value, path)

    def _put(self, tag: str, content: bytes = b"") -> None:
        if self._data:
            self._hash.update(f"{tag} {len(content)}:".encode() + content)

    def _unknown(self, value: Any, path: str) -> None:
        kind = type(value)
        self.unknown.append(f"{path} is of {kind.__module__}.{kind.__qualname__}, which does not show its state")

    def _items(self, tag: str, values: Iterable[Any], path: str) -> None:
        items = list(values)
        self._put(tag, b"%d" % len(items))
        for item in items:
            self.walk(item, f"{path}[]")

    def _object(self, value: Any, path: str) -> None:
        kind = type(value)
        if isinstance(value, types.FunctionType):
            self._function(value, path)
        elif isinstance(value, types.CodeType):
            self._code(value)
        elif isinstance(value, types.MethodType):
            self._put("method")
            self.walk(value.__func__, path)
            self.walk(value.__self__, f"{path}.__self__")
        elif isinstance(value, _NAMED_IN_C):
            self._named_in_c(value, path)
        elif isinstance(value, type):
            self._class(value, path)
        elif isinstance(value, (staticmethod, classmethod)):
            self._put(kind.__name__)
            self.walk(value.__func__, path)
        elif isinstance(value, property):
            self._items("property", (value.fget, value.fset, value.fdel), path)
        elif isinstance(value, types.CellType):
            self._cell(value, path)
        elif isinstance(value, _LOCKS):
            self._put("lock")
        elif isinstance(value, logging.Logger) or value is sys.stdout or value is sys.stderr:
            self._put("writer")
        else:
            self._value(value, path)

    def _value(self, value: Any, path: str) -> None:
        import weakref

        numpy = sys.modules.get("numpy")
        if numpy is not None and isinstance(value, (numpy.ndarray, numpy.generic)):
            self._array(value, path)
        elif callable(getattr(type(value), "detach", None)) and callable(getattr(type(value), "cpu", None)):
            self._tensor(value, path)
        elif isinstance(value, weakref.ref):
            self._put("weak")
            self.walk(value(), path)
        elif isinstance(value, types.MappingProxyType):
            self.walk(dict(value), path)
        elif isinstance(value, memoryview):
            self._put("memory", value.tobytes())
        elif isinstance(value, struct.Struct):
            self._put("struct", str(value.format).encode())
        elif isinstance(value, enum.Enum):
            self._put("member", value.name.encode())
            self.walk(type(value), f"{path}.__class__")
            self.walk(value.value, f"{path}.value")
        else:
            self._instance(value, path)

    def _code(self, code: types.CodeType) -> None:
        digest = _code_digest(code)
        self._codes.add(digest)
        self._put("code", digest.encode())

    def _function(self, function: types.FunctionType, path: str) -> None:
        self._put("function", function.__qualname__.encode())
        self._code(function.__code__)
        around = function.__globals__
        home = _home_of(str(around.get("__name__", "")), around.get("__file__"))
        names = _names_of(function.__code__)
        self._put(home.kind, home.digest.encode())
        self.walk(function.__defaults__, f"{path}.__defaults__")
        self.walk(function.__kwdefaults__, f"{path}.__kwdefaults__")
        for name, cell in zip(function.__code__.co_freevars, function.__closure__ or ()):
            self.walk(cell, f"{path}.{name}")
        for name, value in sorted(vars(function).items()):
            self.walk(value, f"{path}.{name}")
        if home.kind != "own":
            return
        self._functions[id(function)] = _Live({_last_name(path)}, names.all, [])
        self._globals(function, names, path)

    def _globals(self, function: types.FunctionType, names: _Names, path: str) -> None:
        around, reads = function.__globals__, self._functions[id(function)].reads
        reads += [f"{path} calls {name}" for name in sorted(names.all & _READING_METHODS)]
        for name in sorted(names.globals):
            self._put("global", name.encode())
            if name not in around:
                self._put("builtin" if hasattr(builtins, name) else "absent")
                if f"builtins.{name}" in _READS:
                    reads.append(f"{path} uses {name}")
            elif isinstance(around[name], types.ModuleType):
                self._module(around[name], names.all, name, reads)
            else:
                if f"{getattr(around[name], '__module__', '')}.{getattr(around[name], '__qualname__', '')}" in _READS:
                    reads.append(f"{path} uses {name}")
                self.walk(around[name], name)
        for name, level in names.imports:
            self._import(name, level, around, names, reads)

    def _import(self, name: str, level: int, around: Dict[str, Any], names: _Names, reads: List[str]) -> None:
        import importlib.util

        try:
            full = importlib.util.resolve_name("." * level + name, around.get("__package__")) if level else name
            module = importlib.import_module(full)
        except Exception:  # the policy finds it when it is called, or fails there
            self._put("import", name.encode())
            return
        self._module(module, names.all, full, reads)
        while "." in full:  # `import a.b` binds a
            full = full.rpartition(".")[0]
            self._module(sys.modules[full], names.all, full, reads)

    def _module(self, module: types.ModuleType, named: Optional[FrozenSet[str]], path: str, reads: Optional[List[str]] = None) -> None:
        """Of one of the policy's own, what is named; all but modules where that is not known."""
        home = _module_home(module)
        self._put("module", f"{module.__name__} {home.digest}".encode())
        if home.kind != "own":
            if reads is not None:
                reads += [f"{path}.{name}" for name in sorted(named or ()) if f"{module.__name__}.{name}" in _READS]
                if module.__name__.partition(".")[0] in _TALKING_MODULES:
                    reads.append(f"the module {module.__name__}")
            return
        file = getattr(module, "__file__", None)
        if isinstance(file, str) and not file.endswith(".py") and os.path.isfile(file):  # compiled
            with open(file, "rb") as stream:
                self._put("file", hashlib.sha256(stream.read()).digest())
        for name in sorted(vars(module)):
            value = vars(module)[name]
            if named is None and (name.startswith("__") or isinstance(value, types.ModuleType)):
                continue
            if (named is None or name in named) and (id(module), name) not in self._members:
                self._members.add((id(module), name))
                self._put("named", name.encode())
                if isinstance(value, types.ModuleType):
                    self._module(value, named, f"{path}.{name}", reads)
                else:
                    self.walk(value, f"{path}.{name}")

    def _class(self, kind: type, path: str) -> None:
        home = _class_home(kind)
        self._put("class", f"{kind.__qualname__} {kind.__module__ if home.kind != 'own' else ''} {home.digest}".encode())
        if home.kind != "own":
            return
        self._items("bases", kind.__bases__, path)
        if type(kind) is not type:
            self.walk(type(kind), f"{path}.__class__")
        for name, value in sorted(vars(kind).items()):
            if name not in _NOT_OF_A_CLASS:
                self._put("entry", name.encode())
                # Code that names a class makes objects of it.
                is_made = name in ("__init__", "__new__", "__post_init__") and not path.endswith(".__class__") and path != "policy"
                self.walk(value, path if is_made else f"{path}.{name}")

    def _named_in_c(self, value: Any, path: str) -> None:
        owner = getattr(value, "__self__", None)
        self._put("c", f"{getattr(value, '__qualname__', '')} {getattr(value, '__module__', '')}".encode())
        if isinstance(owner, types.ModuleType):
            self._module(owner, frozenset(), path)
        elif owner is not None:
            self.walk(owner, f"{path}.__self__")

    def _cell(self, cell: Any, path: str) -> None:
        try:
            value = cell.cell_contents
        except ValueError:
            self._put("empty")
            return
        if isinstance(value, types.ModuleType):
            self._module(value, None, path)
        else:
            self.walk(value, path)

    def _array(self, array: Any, path: str) -> None:
        import numpy

        self._put("array", f"{numpy.asarray(array).dtype.descr!r} {numpy.shape(array)!r}".encode())
        if numpy.asarray(array).dtype.hasobject:
            self.walk(numpy.asarray(array).tolist(), path)
        elif self._data:
            self._put("numbers", numpy.asarray(array).tobytes())
        if isinstance(array, numpy.ndarray) and type(array) not in (numpy.ndarray, numpy.memmap):
            self.walk(type(array), f"{path}.__class__")
            self._attributes(array, path)

    def _tensor(self, tensor: Any, path: str) -> None:
        self._put("tensor", f"{getattr(tensor, 'dtype', '')} {tuple(getattr(tensor, 'shape', ()))!r}".encode())
        if not self._data:
            return
        try:
            there = tensor.detach().cpu()
            try:
                numbers = there.numpy()
            except TypeError:  # a type that NumPy does not have
                numbers = there.float().numpy()
            self._put("numbers", numbers.tobytes())
        except Exception:
            self._unknown(tensor, path)

    def _attributes(self, value: Any, path: str) -> None:
        attributes = getattr(value, "__dict__", None)
        for name, held in sorted(attributes.items(), key=lambda entry: str(entry[0])) if isinstance(attributes, dict) else ():
            self._put("attribute", str(name).encode())
            self.walk(held, f"{path}.{name}")
        for name, member in _slots_of(type(value)):
            try:
                held = member.__get__(value)
            except AttributeError:
                continue
            self._put("slot", name.encode())
            self.walk(held, f"{path}.{name}")

    def _instance(self, value: Any, path: str) -> None:
        kind = type(value)
        self.walk(kind, f"{path}.__class__")
        known = self._content(value, path)
        self._attributes(value, path)
        if kind in (list, dict, set, frozenset):
            return
        if callable(getattr(kind, "state_dict", None)) and not self._in_weights:
            self._weights(value, path)
        if _hides_state(value):
            self._reduced(value, path, known)

    def _content(self, value: Any, path: str) -> bool:
        """Whether it is a container or a number of a kind of its own; then what that holds is looked at."""
        if isinstance(value, (set, frozenset)):
            self._put("set", b"".join(sorted(self._alone(item, path) for item in value)))
        elif isinstance(value, dict):
            self._put("dict", b"%d" % len(value))
            for key, held in dict.items(value):
                self.walk(key, f"{path}[]")
                self.walk(held, f"{path}[{key if isinstance(key, str) and key.isidentifier() else ''}]")
        elif isinstance(value, (list, tuple)):
            self._items("list", list.__iter__(value) if isinstance(value, list) else tuple.__iter__(value), path)
        else:
            base = next((base for base in _PLAIN if isinstance(value, base)), None)
            if base is None:
                return False
            self._put(base.__name__, _PLAIN[base](base(value) if base is not str else str.__str__(value)))
        return True

    def _alone(self, item: Any, path: str) -> bytes:
        """An element of a set, whose order says nothing."""
        walk = _Walk(self._data)
        walk.walk(item, f"{path}[]")
        self.unknown += walk.unknown
        self._codes |= walk._codes
        self._functions.update(walk._functions)
        self._kept += walk._kept
        return walk.digest().encode()

    def _weights(self, value: Any, path: str) -> None:
        self._in_weights = True
        try:
            self.walk(value.state_dict(), f"{path}.state_dict()")
        except Exception as error:
            self.unknown.append(f"{path}.state_dict() raises {type(error).__name__}")
        finally:
            self._in_weights = False

    def _reduced(self, value: Any, path: str, known: bool) -> None:
        """What it says to pickle."""
        try:
            parts = value.__reduce_ex__(4)
        except Exception:
            if not known:
                self._unknown(value, path)
            return
        if isinstance(parts, str):
            self._put("named", parts.encode())
            return
        for place, part in enumerate(parts):
            if place >= 3 and part is not None:  # iterators over what a list or a dictionary holds
                self._items("held", part, path)
            else:
                self.walk(part, path)


def _last_name(path: str) -> str:
    """Of "policy.parts[]" parts; of the policy itself nothing."""
    return "" if path == "policy" else re.sub(r"\[[^\]]*\]", "", path).rpartition(".")[2]


def identity_of(name: str, policy: Any, version: Optional[str]) -> str:
    """SHA-256 of a policy. With a version, that stands for the data; the code is looked at all the same. Raises
    ValueError where something cannot be known and no version says it."""
    walk = _Walk(data=version is None)
    try:
        walk.walk(policy, "policy")
    except RecursionError:
        walk.unknown.append("more inside one another than can be followed")
    unknown = walk.unknown + [f"{read}: what that gives is known only when it is called" for read in walk.read_outside()]
    if version is None and unknown:
        raise ValueError(f"policy '{name}': expected data that duet can look at, found {'; '.join(unknown[:3])}. Say what "
                         f"the policy is with version='...': rows of two versions are told apart")
    kind = policy if hasattr(policy, "__qualname__") else type(policy)
    said = "" if version is None else f"version {version}"
    return hashlib.sha256(f"{getattr(kind, '__qualname__', '')}\n{said}\n{walk.digest()}".encode()).hexdigest()
