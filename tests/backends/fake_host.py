"""A host whose robot stays where it is, with a fault that its word names: duet.host/1 (docs/extending.md, "A host").

usage: fake_host.py FAULT [STEP]    at the third step, or at this one
"""
import json
import os
import signal
import socket
import struct
import sys
import time

fault, at = sys.argv[1], int(sys.argv[2]) if len(sys.argv) > 2 else 3
duet = socket.socket(fileno=int(os.environ["DUET_HOST_FD"]))


def read_exactly(count):
    data = b""
    while len(data) < count:
        part = duet.recv(count - len(data))
        if not part:
            sys.exit(0)
        data += part
    return data


def answer(kind, number, content):
    duet.sendall(struct.pack("<IIQ", len(content), kind, number) + content)


def ready(message, number):
    text = {"protocol": "duet.host/1", "engine": message["engine"], "version": "1", "memory": 2, "contacts": 1}
    if fault == "refuse":
        return answer(3, number, b"this scene has a link named \x1b[31mred\x1b[0m")
    if fault in text:
        text[fault] = {"contacts": 1.5, "memory": -1}.get(fault, "another")
    if fault == "key":
        text["speed"] = 3
    answer(1, number, b"{" if fault == "json" else json.dumps(text).encode())


def stepped(numbers, joints, steps):
    """The state as it came; no torques; the memory: this process, and how many steps it has made for a world."""
    size = 13 + 2 * joints
    state, memory = list(numbers[:size]), numbers[-2:]
    out = [0.0] + state + [0.0] * joints + [float(os.getpid()), memory[1] + 1.0] + [0.0]
    if steps < at:
        return out
    if fault == "nan":
        out[5] = float("nan")
    elif fault == "infinite":
        out[-2] = float("inf")
    elif fault == "outcome":
        out[0] = 2.0
    elif fault == "diverge":
        out[0] = 1.0
    elif fault == "norm":
        out[4] = 0.5
    elif fault == "speed":
        out[8] = 2e4
    elif fault == "count":
        out[-1] = 1.0
    elif fault in ("link", "side", "other"):
        contact = {"link": 0.0, "side": 0.0, "other": -1.0}
        contact[fault] = 77.0
        if fault == "other":
            contact["side"] = 2.0
        out[-1] = 1.0
        out += list(contact.values()) + [0.0] * 7
    return out


scene, steps = None, 0
while True:
    length, kind, number = struct.unpack("<IIQ", read_exactly(16))
    content = read_exactly(length)
    if kind == 1:
        scene = json.loads(content)
        ready(scene, number)
        continue
    steps += 1
    joints = len(scene["scene"]["robot"]["joints"])
    data = stepped(struct.unpack("<%dd" % (length // 8), content), joints, steps)
    packed = struct.pack("<%dd" % len(data), *data)
    if steps >= at:
        if fault == "exit":
            sys.exit(7)
        if fault == "kill":
            os.kill(os.getpid(), signal.SIGKILL)
        if fault == "close":
            duet.close()
            time.sleep(60)
        if fault == "late":
            time.sleep(60)
        if fault == "stall":  # the first half of an answer
            duet.sendall(struct.pack("<IIQ", len(packed), 2, number) + packed[:len(packed) // 2])
            time.sleep(60)
        if fault == "short":
            packed = packed[:-8]
        if fault == "long":
            packed += bytes(1 << 20)
        if fault == "odd":
            packed += bytes(3)
        if fault == "echo":
            number += 1
        if fault == "kind":
            answer(9, number, packed)
            continue
        if fault == "say":
            answer(3, number, "its solver met a wall".encode())
            continue
    answer(2, number, packed)
