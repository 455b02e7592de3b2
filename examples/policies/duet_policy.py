"""Serves a policy to duet: connection and messages (docs/extending.md). Standard library only."""
import json
import os
import select
import socket
import struct
import threading


def read_exactly(connection, count):
    data = b""
    while len(data) < count:
        part = connection.recv(count - len(data))
        if not part:
            raise EOFError("duet closed the connection")
        data += part
    return data


def read(connection):
    (length,) = struct.unpack("<I", read_exactly(connection, 4))
    return json.loads(read_exactly(connection, length))


def write(connection, message):
    data = json.dumps(message).encode()
    connection.sendall(struct.pack("<I", len(data)) + data)


def answer(connection, make_policy):
    """One policy, until duet says bye. `make_policy(hello)` gives an object with reset(episode) and plan(observation)."""
    hello = read(connection)
    policy = make_policy(hello)
    write(connection, {"type": "hello", "version": 1, "joints": hello["joints"]})
    while (message := read(connection))["type"] != "bye":
        # What is late is worth nothing: of several observations that wait only the newest is answered.
        while message["type"] == "observe" and select.select([connection], [], [], 0)[0]:
            message = read(connection)
        if message["type"] == "reset":
            policy.reset(message)
            write(connection, {"type": "ready"})
        elif message["type"] == "observe":
            write(connection, {"type": "plan", "tick": message["tick"], "anchors": policy.plan(message)})
        else:
            break


def serve(make_policy, path="duet_policy.sock"):
    """Answers the duet that started this program; else listens at `path` for any number of them."""
    if "DUET_POLICY_FD" in os.environ:
        return answer(socket.socket(fileno=int(os.environ["DUET_POLICY_FD"])), make_policy)
    if os.path.exists(path):
        os.remove(path)
    with socket.socket(socket.AF_UNIX) as server:
        server.bind(path)
        server.listen()
        while True:
            threading.Thread(target=answer, args=(server.accept()[0], make_policy), daemon=True).start()
