#!/usr/bin/env python3
"""An estimator on another computer, with Python's own library alone: a person 2 m before the camera, 30 times a second.

usage: estimator.py HOST PORT KEY_FILE [PICTURES]        docs/hardware.md, "Over a network", has each byte
"""
import hmac
import itertools
import random
import socket
import struct
import sys
import time

HELLO, TICKET, PERSON = 1, 2, 4
SENDER = 5  # 0 to 15, another for each program that sends to this guard
HEAD = struct.Struct("<IHHQQd")  # form, kind, sender, ticket, sequence, clock: 32 bytes
JOINTS = [[0.0, 0.3 - 0.05 * j, 2.0] for j in range(24)]  # SMPL-24: x right, y down, z ahead [m]

host, port, key_file = sys.argv[1:4]
key = bytes.fromhex(open(key_file).read().strip())
guard = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
guard.connect((host, int(port)))
guard.settimeout(0.1)


def seal(kind, ticket, sequence, carried=b""):
    before = HEAD.pack(0x314E5544, kind, SENDER, ticket, sequence, time.monotonic()) + carried
    return before + hmac.digest(key, before, "sha256")


hello, sequence = random.getrandbits(62), 0
for number in itertools.count(1) if len(sys.argv) < 5 else range(1, int(sys.argv[4]) + 1):
    exposed_at = time.monotonic()  # here the picture is taken, and the person found in it
    hello += 1
    try:
        guard.send(seal(HELLO, 0, hello))
        answer = guard.recv(9000)
    except OSError as error:
        print(f"the guard at {host}:{port} does not answer: {error}", file=sys.stderr)
        continue
    if not hmac.compare_digest(hmac.digest(key, answer[:-32], "sha256"), answer[-32:]):
        continue  # not of who has the key
    kind, ticket, (echo, largest) = answer[4], HEAD.unpack_from(answer)[3], struct.unpack_from("<QQ", answer, 32)
    if kind != TICKET or echo != hello:
        continue  # an answer to an earlier hello
    sequence = max(sequence, largest) + 1
    now = time.monotonic()
    estimate = struct.pack("<4sIQd72dd", b"DPJ2", 1, number, now, *itertools.chain(*JOINTS), now - exposed_at)
    guard.send(seal(PERSON, ticket, sequence, estimate))
    time.sleep(1 / 30)
