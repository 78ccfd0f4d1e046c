"""Reads exports with other projects' readers, one function for each."""

import csv
import json
from pathlib import Path

import numpy as np



def from_csv(path):
    """The header, and the rows as text."""
    with open(path, newline="") as file:
        rows = list(csv.reader(file))
    return rows[0], rows[1:]


def from_pcd(path):
    import pypcd4

    cloud = pypcd4.PointCloud.from_path(path)
    return list(cloud.fields), cloud.pc_data


def from_ply(path):
    import plyfile

    vertex = plyfile.PlyData.read(path)["vertex"].data
    return list(vertex.dtype.names), vertex


def from_mcap(path):
    """The point clouds and the statistics, each with its log time."""
    from mcap.reader import make_reader
    from mcap_protobuf.decoder import DecoderFactory

    clouds, statistics = [], []
    with open(path, "rb") as file:
        reader = make_reader(file, decoder_factories=[DecoderFactory()], validate_crcs=True)
        for message in reader.iter_decoded_messages(topics=["/events"]):
            clouds.append((message.message.log_time, message.decoded_message))
    with open(path, "rb") as file:
        reader = make_reader(file, validate_crcs=True)
        for _, channel, message in reader.iter_messages(topics=["/statistics"]):
            assert channel.message_encoding == "json"
            statistics.append((message.log_time, json.loads(message.data)))
    return clouds, statistics


def from_ros2(path):
    """The messages of a bag of ROS 2, each with its log time."""
    from rosbags.highlevel import AnyReader

    with AnyReader([Path(path)]) as bag:
        assert {(topic, of.msgtype) for topic, of in bag.topics.items()} == {
            ("/dtof/points", "sensor_msgs/msg/PointCloud2")
        }
        return [
            (time, bag.deserialize(data, connection.msgtype))
            for connection, time, data in bag.messages()
        ]


def points_of_ros2(message):
    """The points of one cloud of a bag."""
    types = {2: "<u1", 6: "<u4", 7: "<f4", 8: "<f8"}
    assert all(field.count == 1 for field in message.fields)
    dtype = np.dtype({
        "names": [field.name for field in message.fields],
        "formats": [types[field.datatype] for field in message.fields],
        "offsets": [field.offset for field in message.fields],
        "itemsize": message.point_step,
    })
    return np.frombuffer(message.data.tobytes(), dtype)


def points_of(cloud):
    """The points of one cloud of an MCAP file."""
    types = {1: "<u1", 5: "<u4", 7: "<f4", 8: "<f8"}
    dtype = np.dtype({
        "names": [field.name for field in cloud.fields],
        "formats": [types[field.type] for field in cloud.fields],
        "offsets": [field.offset for field in cloud.fields],
        "itemsize": cloud.point_stride,
    })
    return np.frombuffer(cloud.data, dtype)


def evt2_with_faery(path, array):
    import faery

    stream = faery.events_stream_from_file(path)
    assert tuple(stream.dimensions()) == array, stream.dimensions()
    events = stream.to_array()
    return list(zip(*(events[key].astype(int).tolist() for key in ("t", "x", "y", "on"))))


def evt2_with_expelliarmus(path, array):
    import expelliarmus

    events = expelliarmus.Wizard(encoding="evt2").read(path)
    return list(zip(*(events[key].astype(int).tolist() for key in ("t", "x", "y", "p"))))


def evt2_with_evlib(path, array):
    import evlib
    import polars

    events = evlib.load_events(path).collect()
    time = events["t"].dt.total_microseconds().to_list()
    on = (events["polarity"] > 0).cast(polars.Int64).to_list()
    return list(zip(time, events["x"].to_list(), events["y"].to_list(), on))


EVT2_READERS = [evt2_with_faery, evt2_with_expelliarmus, evt2_with_evlib]
