#!/usr/bin/env python3
"""A rig for `host-sim bridge` with nothing attached: it says that everything rests, and prints what it is told.

Usage: python3 rig.py [PORT [ADDRESS]]    (those of the bridge's --send-to; 47361 127.0.0.1)

Put your sensors where it says 0.0, and your actuators where it prints.
"""
import socket
import struct
import sys
import time
import zlib

HEADER = struct.Struct("<4sIII QQQ")   # magic, version, kind, 0, run, number, time of sending
NEEDLE = struct.Struct("<II Q dd")     # number of the sample, 0, time, depth, velocity
TARGET = struct.Struct("<II Q 3d")     # number, 1 where it is seen, time, displacement
PADDLE = struct.Struct("<II Q 3d")     # number, index of the paddle, time, displacement
COMMAND = struct.Struct("<II QQQ 6d II 2I II")
HELLO = struct.Struct("<II 2I 24s")
FRAMES = {1: HELLO, 5: COMMAND}        # what the bridge says
MODES = {1: "HOLD", 2: "RUN", 3: "SAFE"}
PERIOD = 0.005                         # s, as the controller's --rate 200 has it
WATCHDOG = 0.1                         # s without a command after which the actuators stay where they are

clock = time.monotonic_ns              # one steady clock for everything that is sent


def take(data):
    """Kind, run, number and frame of a datagram of the bridge; None for anything else."""
    if len(data) < HEADER.size + 4 or zlib.crc32(data[:-4]) != struct.unpack("<I", data[-4:])[0]:
        return None
    magic, version, kind, _, run, number, _ = HEADER.unpack(data[:HEADER.size])
    frame = data[HEADER.size:-4]
    if (magic, version) != (b"SPBR", 1) or kind not in FRAMES or len(frame) != FRAMES[kind].size:
        return None
    return kind, run, number, frame


link = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
port, address = sys.argv[1:3] + ["47361", "127.0.0.1"][len(sys.argv[1:3]):]
link.bind((address, int(port)))
taken = None
while taken is None or taken[0] != 1:  # until the bridge says Hello
    data, bridge = link.recvfrom(2048)
    taken = take(data)
_, run, newest, frame = taken
dimension, count, first, second, unit = HELLO.unpack(frame)
paddles = (first, second)[:count]
print(f"{dimension} dimensions, unit of length {unit.rstrip(bytes(1)).decode()}, paddles {paddles}", flush=True)
link.setblocking(False)

number = 0


def send(kind, frame):
    """One datagram: a larger number than the one before, the time of sending, and the checksum."""
    global number
    data = HEADER.pack(b"SPBR", 1, kind, 0, run, number, clock()) + frame
    link.sendto(data + struct.pack("<I", zlib.crc32(data)), bridge)
    number += 1


shown, heard, held_up, tick, due = None, clock(), False, 0, time.monotonic()
while clock() - heard < 2_000_000_000:  # until the bridge has been silent for 2 s
    measured = clock()
    send(2, NEEDLE.pack(tick, 0, measured, 0.0, 0.0))
    for index in paddles:
        send(4, PADDLE.pack(tick, index, measured, 0.0, 0.0, 0.0))
    if tick % 4 == 0:                  # the target's sensor has a rate of its own
        send(3, TARGET.pack(tick // 4, 1, measured, 0.0, 0.0, 0.0))
    while True:
        try:
            data, sender = link.recvfrom(2048)
        except BlockingIOError:
            break
        taken = take(data) if sender == bridge else None
        # Late and doubled ones are not obeyed, nor is another run of the bridge.
        if taken is None or taken[0] != 5 or taken[1] != run or taken[2] <= newest:
            continue
        newest, heard = taken[2], clock()
        if held_up:
            continue
        fields = COMMAND.unpack(taken[3])
        state, goals, valid = fields[1], fields[5:11], fields[15] & 1
        now = (MODES.get(state), "go to" if valid else "keep")
        if now != shown:
            print(*now, *(f"{goal:+.6f}" for goal in goals[:3 * count]), flush=True)
            shown = now
    if clock() - heard > WATCHDOG * 1e9 and shown != ("-", "keep"):
        shown = ("-", "keep")          # nobody says anything: stay
        print(*shown, flush=True)
    tick += 1
    due += PERIOD
    time.sleep(max(0.0, due - time.monotonic()))
    # Where this program itself was held up, what waits is old, and nobody may move by it.
    held_up = time.monotonic() - due > WATCHDOG
    if held_up:
        due, heard, shown = time.monotonic(), clock(), ("-", "keep")
        print(*shown, flush=True)
