"""Reads what `dtof view --foxglove` serves, with other projects' programs, and compares.

python live.py DTOF SCENE.aer DOCS.md. Messages are decoded with the schemas that the server gives, not with any
of this project. Whatever does not agree ends it with a traceback.
"""

import base64
import json
import re
import struct
import subprocess
import sys
import time

import numpy as np
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory
from websockets.sync.client import connect

import aer
import expected
import read

TOPICS = {"/events", "/statistics", "/losses", "/range", "/rate", "/reflectivity", "/log"}


def decoder(channel):
    """The decoder of a channel, from its own schema."""
    if channel["encoding"] == "json":
        schema = json.loads(channel["schema"])
        assert channel["schemaEncoding"] == "jsonschema" and schema["type"] == "object"

        def decode(data):
            message = json.loads(data)
            # Without a device it has no counts.
            assert message.keys() <= schema["properties"].keys(), message
            for key, value in message.items():
                kind = {"integer": int, "number": (int, float), "string": str, "object": dict}
                assert isinstance(value, kind[schema["properties"][key]["type"]]), (key, value)
            return message

        return decode
    assert (channel["encoding"], channel["schemaEncoding"]) == ("protobuf", "protobuf")
    files = descriptor_pb2.FileDescriptorSet.FromString(base64.b64decode(channel["schema"]))
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    kind = message_factory.GetMessageClass(pool.FindMessageTypeByName(channel["schemaName"]))
    return kind.FromString


def nanoseconds(stamp):
    return stamp.seconds * 10**9 + stamp.nanos


def client(address):
    """The messages of all topics until the recording has ended: (topic, time, message)."""
    messages = []
    with connect(address, subprotocols=["foxglove.sdk.v1"], max_size=None, open_timeout=60) as socket:
        assert socket.subprotocol == "foxglove.sdk.v1"
        info = json.loads(socket.recv(timeout=60))
        assert info["op"] == "serverInfo" and info["capabilities"] == [], info
        advertise = json.loads(socket.recv(timeout=60))
        assert advertise["op"] == "advertise"
        channels = {channel["id"]: channel for channel in advertise["channels"]}
        assert {channel["topic"] for channel in channels.values()} == TOPICS
        decode = {id: decoder(channel) for id, channel in channels.items()}
        subscriptions = [{"id": id + 7, "channelId": id} for id in channels]
        socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
        while not any(topic == "/log" and message.message == "ended" for topic, _, message in messages):
            data = socket.recv(timeout=60)
            if isinstance(data, str):
                # The recording began after the client had connected.
                assert json.loads(data)["op"] == "serverInfo", data
                continue
            opcode, subscription, stamp = struct.unpack_from("<BIQ", data)
            id = subscription - 7
            assert opcode == 1
            messages.append((channels[id]["topic"], stamp, decode[id](data[13:])))
    return messages


def image(message):
    assert (message.encoding, message.frame_id) == ("32FC1", "dtof_optical")
    assert message.step == 4 * message.width
    return np.frombuffer(message.data, "<f4").reshape(message.height, message.width)


def check(header, events, messages, laser_hz):
    of = {topic: [m for m in messages if m[0] == topic] for topic in TOPICS}
    assert all(of.values()), {topic: len(found) for topic, found in of.items()}
    for topic in ("/events", "/range", "/rate", "/reflectivity", "/log"):
        assert all(nanoseconds(message.timestamp) == time for _, time, message in of[topic]), topic
    for topic in ("/statistics", "/losses"):
        assert all(m["timestamp"]["sec"] * 10**9 + m["timestamp"]["nsec"] == time for _, time, m in of[topic])
    for found in of.values():
        times = [time for _, time, _ in found]
        assert times == sorted(times)

    # All points of the file, in order of time.
    assert of["/losses"][-1][2]["points_left_out"] == 0
    clouds = [read.points_of(message) for _, _, message in of["/events"]]
    cloud = np.concatenate(clouds)
    order = sorted(range(len(events)), key=lambda index: events[index].cycle)
    expected_records = expected.records(header, events, laser_hz)
    for column, field in enumerate(["intensity", "pixel", "flags", "level", "echo", "t_ns"]):
        assert cloud[field].tolist() == [expected_records[index][column] for index in order], field
    point = np.stack([cloud[axis] for axis in "xyz"], axis=1)
    ray = expected.rays(header, None, events)[order]
    metres = np.array([expected.range_mm(header, events[index]) / 1000 for index in order])
    assert np.abs(point - ray * metres[:, None]).max() < 1.1e-5
    statistics = [message for _, _, message in of["/statistics"]]
    assert [s["events"] for s in statistics] == [len(cloud) for cloud in clouds]
    assert statistics[-1]["events_so_far"] == len(events) == of["/losses"][-1][2]["events"]
    assert sum(s["flagged"] for s in statistics) == sum(event.flags != 0 for event in events)

    # The last range of each pixel: the first echo counts, and a block sets several pixels.
    ranges = image(of["/range"][-1][2]).reshape(-1)
    assert len(ranges) == header.columns * header.rows
    assert all(event.level == 0 for event in events), "blocks: not compared here"
    last = {event.pixel: expected.range_mm(header, event) / 1000 for event in events if event.echo == 1}
    assert set(np.flatnonzero(~np.isnan(ranges)).tolist()) == set(last)
    assert all(abs(ranges[pixel] - metres) < 1.1e-5 for pixel, metres in last.items())
    light = image(of["/reflectivity"][-1][2]).reshape(-1)
    assert np.array_equal(np.isnan(light), np.isnan(ranges))
    assert np.nanmax(image(of["/rate"][-1][2])) >= 0
    assert [message.message for _, _, message in of["/log"]][-1] == "ended"
    return len(cloud)


def serve(dtof, path, seconds, laser_hz, check_with):
    """Plays a file in about this many seconds."""
    header, events = aer.read(path)
    length = max(event.cycle for event in events) / laser_hz
    options = ["--speed", str(length / seconds), "--laser-hz", str(laser_hz), "--foxglove=0"]
    program = subprocess.Popen([dtof, "view", path, *options], stdout=subprocess.PIPE, text=True)
    try:
        page, address = (program.stdout.readline().strip() for _ in range(2))
        assert page.startswith("http://127.0.0.1:") and address.startswith("ws://127.0.0.1:"), (page, address)
        return check_with(header, events, address)
    finally:
        program.kill()
        program.wait()


def documented(docs):
    """Runs the Python code of docs/view.md with another address."""
    return re.search(r"```python\n(.*?)```", open(docs).read(), re.S)[1]


def main(dtof, scene, docs):
    header, events = aer.read(scene)
    # The client has subscribed before the first of them.
    latest = max(event.cycle for event in events)
    later = [event._replace(cycle=event.cycle + 2 * latest) for event in events]
    aer.write("live.aer", header, later)
    header, events = aer.read("live.aer")

    def check_with(header, events, address):
        return check(header, events, client(address), 10_000_000)

    points = serve(dtof, "live.aer", 9, 10_000_000, check_with)
    print(f"live: {points} points, {len(TOPICS)} topics: all agree")

    def run(header, events, address):
        # It has begun.
        time.sleep(2)
        code = documented(docs).replace("ws://127.0.0.1:8765", address)
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, timeout=60)
        assert done.returncode == 0 and done.stdout.strip(), done

    serve(dtof, "live.aer", 30, 10_000_000, run)
    print("live: the Python of docs/view.md runs")


if __name__ == "__main__":
    main(*sys.argv[1:])
