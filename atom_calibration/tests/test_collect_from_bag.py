"""A bag becomes a dataset; what is wrong with a bag is said in one line (see stand_in_rig.py)."""

import json

import numpy as np
import pytest
import rosbag
from stand_in_rig import (
    CONFIG,
    GRID,
    STOPS,
    StandIn,
    cloud,
    messages,
    position,
    refusal,
)

from atom_calibration.labels.frame_labeler import FrameLabeler
from atom_calibration.nodes.collecting.collect_from_bag import main
from atom_core.cli import main as core_main
from atom_core.io.dataset_json import read_dataset
from atom_core.labeling.base import nothing
from atom_core.model.dataset import range_points
from atom_core.model.labels import DetectionKey
from atom_core.model.transforms import Edge


def test_each_stop_becomes_a_collection_with_its_data_labels_and_transforms(place):
    assert main(place()) == 0
    dataset = read_dataset(place.folder / "dataset.json")
    assert list(dataset.collections) == ["000", "001", "002"]
    for number, (key, collection) in enumerate(dataset.collections.items()):
        corners = collection.labels[("cam", "board")]
        np.testing.assert_array_equal(corners.pixels, GRID + position(2.5 * number))
        points = range_points(dataset, DetectionKey(key, "lidar", "board")).inside
        np.testing.assert_allclose(points[:, 0], 3 + 0.05 * position(2.5 * number), atol=1e-6)
        assert dataset.data.read(key, "cam").shape == (48, 64, 3)
        stamp = dataset.document["collections"][key]["data"]["lidar"]["header"]["stamp"]
        arm_x = collection.transforms[Edge("world", "arm")][0, 3]
        seconds = stamp["secs"] + 1e-9 * stamp["nsecs"] - 100.0
        assert 2.5 * number <= seconds <= 2.5 * number + 1.5
        assert arm_x == pytest.approx(0.1 * seconds, abs=1e-6)  # the LiDAR's own stamp
    types = {name: entry["type"] for name, entry in dataset.document["transforms"].items()}
    assert types["world-arm"] == "multiple" and types["arm-lidar"] == "fixed"
    initial = dataset.document["patterns"]["board"]["transforms_initial"]
    assert initial["001"]["detected"] and initial["001"]["sensor"] == "cam"
    assert core_main(["check", "--dataset", str(place.folder / "dataset.json")]) in (0, 1)


def test_the_skew_is_compared_in_milliseconds(place, make):
    arguments = place(messages(make, lag_s=0.05))
    place.config.write_text(CONFIG.replace("msgs: 200", "msgs: 20"))
    assert main(arguments) == 1  # no two sensors within 20 ms, so one of them has nothing
    dataset = read_dataset(place.folder / "dataset.json")
    for entry in dataset.document["collections"].values():
        assert len(entry["data"]) == 1


def test_a_sensor_whose_stamps_are_too_far_from_the_others_is_named_with_the_remedy(
    place, make, capsys
):
    arguments = place(messages(make, lag_s=0.05))
    place.config.write_text(CONFIG.replace("msgs: 200", "msgs: 20"))
    assert main(arguments) == 1
    said = capsys.readouterr().err
    assert "sensor 'lidar' saw the board in 3 of 3 collections and is not in them" in said
    assert "would last 50 ms; raise max_duration_between_msgs" in said


def test_a_time_without_data_names_the_nearest_and_the_setting(place, capsys):
    arguments = [*place(), "--times", "100.575"]
    place.config.write_text(CONFIG.replace("msgs: 200", "msgs: 20"))
    line = refusal(arguments, capsys)
    assert "no sensor has data within 10 ms" in line and "'cam', 25 ms away" in line
    assert "raise max_duration_between_msgs, which is 20 ms" in line


def test_an_interval_takes_collections_and_leaves_out_what_moves(place, capsys):
    assert main([*place(), "--interval", "0.5"]) == 1
    assert "the board moved by" in capsys.readouterr().err
    dataset = read_dataset(place.folder / "dataset.json")
    assert 3 * STOPS - 2 <= len(dataset.collections) <= 3 * STOPS + 2


def test_an_interval_shorter_than_the_data_takes_each_of_them_once(place, capsys):
    assert main([*place(), "--interval", "0.04"]) == 1
    said = capsys.readouterr().err
    assert "had the very data of the collection before" in said
    document = read_dataset(place.folder / "dataset.json").document
    stamps = [
        tuple(
            sorted(
                (n, d["header"]["stamp"]["secs"], d["header"]["stamp"]["nsecs"])
                for n, d in c["data"].items()
            )
        )
        for c in document["collections"].values()
    ]
    assert len(stamps) > 5 * STOPS and len(set(stamps)) == len(stamps)


def test_moments_between_the_data_are_counted_and_cost_nothing(place, make, capsys):
    slow = [m for m in messages(make, lag_s=0.0) if m[2] < 101.5]  # it stands still, at 10 Hz
    arguments = place(slow)
    place.config.write_text(CONFIG.replace("msgs: 200", "msgs: 20"))
    assert main([*arguments, "--interval", "0.015"]) == 0
    said = capsys.readouterr().err
    assert "moments lie between the data and are not taken" in said
    assert "no collection is taken" not in said
    assert len(read_dataset(place.folder / "dataset.json").collections) >= 14


def test_moments_that_miss_the_data_are_told_once(place, make, capsys):
    slow = [m for m in messages(make, lag_s=0.0) if m[2] < 101.5]
    arguments = place(slow)
    place.config.write_text(CONFIG.replace("msgs: 200", "msgs: 20"))
    assert main([*arguments, "--interval", "0.13"]) == 1
    said = capsys.readouterr().err
    assert said.count("no sensor has data within 10 ms") == 1
    assert "more moments have no data within 10 ms: raise max_duration_between_msgs" in said


def test_a_stop_where_the_board_stood_before_is_told(place, make, capsys):
    content = []
    for topic, message, time in messages(make):
        if 102.5 <= time < 104.1:  # the second stop; the board is back where it was
            image = np.zeros((48, 64, 3), np.uint8)
            image[0, 0, 0] = position(0.0)
            if topic == "/cam/image_raw":
                message = make.image(image, frame="cam_optical", stamp_s=time)
            elif topic == "/lidar/points":
                message = cloud(make, position(0.0), time)
        content.append((topic, message, time))
    assert main(place(content)) == 0
    said = capsys.readouterr().err
    assert "the board stands where it stood at the stop before" in said and ": 1 stop\n" in said
    assert len(read_dataset(place.folder / "dataset.json").collections) == STOPS - 1


def test_a_time_beyond_the_recording_is_said_to_be_that(place, capsys):
    line = refusal([*place(), "--times", "3"], capsys)
    assert "time 3.000" in line and "the recording has data from 100.000 to 107" in line
    assert "max_duration" not in line


def test_times_that_are_given_are_taken_to_the_frame(place, make):
    arguments = place(messages(make, lag_s=0.0))
    place.config.write_text(CONFIG.replace("msgs: 200", "msgs: 20"))
    assert main([*arguments, "--times", "100.1", "100.4", "100.9"]) == 0
    for collection in read_dataset(place.folder / "dataset.json").collections.values():
        assert {name for name, _ in collection.labels} == {"cam", "lidar"}


def test_times_that_are_given_are_taken(place):
    assert main([*place(), "--times", "103.1", "100.6"]) == 0
    document = read_dataset(place.folder / "dataset.json").document
    secs = [c["data"]["cam"]["header"]["stamp"] for c in document["collections"].values()]
    assert [s["secs"] + 1e-9 * s["nsecs"] for s in secs] == pytest.approx([100.6, 103.1], abs=0.11)


def test_the_seeds_in_use_are_written_and_win_when_they_come_back(place, capsys):
    arguments = [*place(), "--overwrite"]
    assert main(arguments) == 0
    seeds = place.folder / "seeds.yaml"
    assert seeds.read_text().count("lidar") == STOPS
    kept = place.folder.parent / "kept.yaml"
    kept.write_text(seeds.read_text())
    assert main([*arguments, "--seeds", str(kept), "--automatic_seeds", "off"]) == 0
    kept.write_text("- {stamp: null, sensor: lidar, xyz_m: [9, 0, 0]}\n")
    assert main([*arguments, "--seeds", str(kept)]) == 1
    assert "sensor 'lidar' never saw the board" in capsys.readouterr().err


def test_a_seed_outside_the_cloud_is_refused(place, capsys):
    arguments = [*place(), "--seeds", str(place.folder.parent / "seeds.yaml")]
    text = "- {stamp: 100.53, sensor: lidar, xyz_m: [50, 0, 0]}\n"
    (place.folder.parent / "seeds.yaml").write_text(text)
    line = refusal(arguments, capsys)
    assert "'lidar', topic /lidar/points, time 100.530" in line and "outside the data" in line


def test_pictures_are_written_when_asked(place):
    assert main([*place(), "--pictures"]) == 0
    assert len(list((place.folder / "pictures").glob("*.jpg"))) == 2 * STOPS


def without(make, *topics):
    return [m for m in messages(make) if m[0] not in topics]


def test_an_absent_topic_names_the_sensor_and_lists_the_topics_of_its_type(place, make, capsys):
    changed = [("/other" if m[0] == "/lidar/points" else m[0], *m[1:]) for m in messages(make)]
    line = refusal(place(changed), capsys)
    assert "/lidar/points (sensor 'lidar')" in line and "PointCloud2: /other" in line


def test_a_camera_without_camera_info_is_refused(place, make, capsys):
    line = refusal(place(without(make, "/cam/camera_info")), capsys)
    assert "/cam/camera_info (intrinsics of sensor 'cam') is not in the bag" in line


def test_a_topic_of_another_type_is_refused(place, capsys):
    arguments = place()
    place.config.write_text(CONFIG.replace("/lidar/points", "/cam/image_raw"))
    assert "carries sensor_msgs/Image" in refusal(arguments, capsys)


def test_a_frame_that_is_not_in_tf_is_refused_with_its_sensor(place, make, capsys):
    arguments = place([m for m in messages(make) if "arm" not in str(m[1])[:400]])
    line = refusal(arguments, capsys)
    assert "sensor 'lidar', topic /lidar/points" in line and "'lidar' is in no message" in line


def test_a_bag_without_tf_is_refused(place, make, capsys):
    assert "neither /tf nor" in refusal(place(without(make, "/tf", "/tf_static")), capsys)


def test_an_edge_that_is_not_on_the_way_is_refused(place, capsys):
    arguments = place()
    place.config.write_text(CONFIG.replace("parent_link: arm", "parent_link: cam"))
    assert "sensor 'lidar': its edge 'cam-lidar'" in refusal(arguments, capsys)


def test_a_gap_of_tf_costs_the_collection_in_it_and_is_told(place, make, capsys):
    gappy = [m for m in messages(make) if not (m[0] == "/tf" and 102.2 < m[2] < 104.3)]
    assert main(place(gappy)) == 1
    assert "/tf has no pose of 'world-arm' near time 103" in capsys.readouterr().err
    assert len(read_dataset(place.folder / "dataset.json").collections) == STOPS - 1


def test_a_gap_of_the_arm_that_carries_the_board_costs_the_collection_in_it(place, make, capsys):
    in_hand = CONFIG.replace("{link: board, parent_link: world", "{link: board, parent_link: hand")
    place.config.write_text(in_hand)
    content = []
    for topic, message, time_s in messages(make):
        if topic == "/tf" and not 102.4 < time_s < 105.2:
            hand = make.transform("world", "hand", np.eye(4), time_s)
            message.transforms.append(hand)
        content.append((topic, message, time_s))
    assert main(place(content)) == 1
    assert "no pose of 'world-hand' near time 103.2" in capsys.readouterr().err
    dataset = read_dataset(place.folder / "dataset.json")
    assert len(dataset.collections) == 2
    assert all(Edge("world", "hand") in c.transforms for c in dataset.collections.values())


@pytest.mark.parametrize("bad, time_s", [([30], 103.0), ([0], 100.0), ([0, 1, 2], 100.2)])
def test_an_empty_image_is_left_out_and_told_wherever_it_stands(place, make, capsys, bad, time_s):
    spoiled = list(messages(make))
    images = [m for topic, m, _ in spoiled if topic == "/cam/image_raw"]
    for number in bad:
        images[number].data = b""
    assert main(place(spoiled)) == 0
    error = capsys.readouterr().err
    assert f"sensor 'cam', topic /cam/image_raw, time {time_s:.3f}: the image is empty" in error
    assert list(read_dataset(place.folder / "dataset.json").collections) == ["000", "001", "002"]


def test_how_many_messages_are_left_out_is_told_where_they_are_many(place, make, capsys):
    spoiled = list(messages(make))
    images = [m for topic, m, _ in spoiled if topic == "/cam/image_raw"]
    for message in images[3::10]:
        message.data = b""
    main(place(spoiled))
    told = capsys.readouterr().err
    assert told.count("a message is left out: sensor 'cam'") == 3
    assert f"sensor 'cam': in all, 8 of {len(images)} messages are left out" in told


def test_a_sensor_all_of_whose_images_are_empty_is_refused(place, make, capsys):
    assert main(place()) == 0
    before = read_dataset(place.folder / "dataset.json").document
    spoiled = list(messages(make))
    for topic, message, _ in spoiled:
        if topic == "/cam/image_raw":
            message.data = b""
    assert "time 100.000: the image is empty" in refusal([*place(spoiled), "--overwrite"], capsys)
    assert read_dataset(place.folder / "dataset.json").document == before  # it is back


def test_a_cloud_without_positions_is_refused(place, make, capsys):
    spoiled = list(messages(make))
    for topic, message, _ in spoiled:
        if topic == "/lidar/points":
            message.fields = message.fields[:2]
    line = refusal(place(spoiled), capsys)
    assert "sensor 'lidar', topic /lidar/points, time 100.030" in line and "no field z" in line


def test_a_board_that_never_rests_is_told(place, make, capsys):
    moving = list(messages(make))
    for number, (topic, message, _) in enumerate(moving):
        if topic == "/cam/image_raw":
            message.data = bytes([1 + number // 4]) + message.data[1:]
    arguments = place([m for m in moving if m[0] != "/lidar/points"])
    text = CONFIG[: CONFIG.index("  lidar:")] + CONFIG[CONFIG.index("calibration_patterns") :]
    place.config.write_text(text)
    assert "the board never stood still" in refusal(arguments, capsys)


def test_a_sensor_that_never_saw_the_board_is_named_with_the_reason(place, make, capsys):
    blind = list(messages(make))
    for topic, message, _ in blind:
        if topic == "/cam/image_raw":
            message.data = bytes(len(message.data))
    assert main(place(blind)) == 1
    said = capsys.readouterr()
    assert "warning: sensor 'cam' never saw the board in a collection" in said.err
    (line,) = [x for x in said.out.splitlines() if x.startswith("cam ")]
    assert "never: no markers" in line
    assert len(read_dataset(place.folder / "dataset.json").collections) == STOPS


def test_a_board_that_no_sensor_sees_is_refused_with_each_ones_reason(place, make, capsys):
    blind = [m for m in messages(make) if m[0] != "/lidar/points"]
    for topic, message, _ in blind:
        if topic == "/cam/image_raw":
            message.data = bytes(len(message.data))
    arguments = place(blind)
    text = CONFIG[: CONFIG.index("  lidar:")] + CONFIG[CONFIG.index("calibration_patterns") :]
    place.config.write_text(text)
    line = refusal(arguments, capsys)
    assert "no collection was taken" in line and "cam: no markers" in line


def test_what_searches_say_is_told_and_not_that_most_frames_are_not_searched(
    place, capsys, monkeypatch
):
    monkeypatch.setattr(
        StandIn, "label", lambda self, data, seed=None: nothing(self.modality, "all is dark")
    )
    assert "lidar: all is dark" in refusal(place(), capsys)


def test_a_bag_damaged_inside_leaves_the_collections_before_it(place, make, capsys):
    content = messages(make, stops=8)
    arguments = place(content, compression=rosbag.Compression.BZ2, chunk_threshold=100000)
    path = place.folder.parent / "a.bag"
    data = bytearray(path.read_bytes())
    chunk = data.index(b"BZh9", 7 * len(data) // 8)
    data[chunk + 20 : chunk + 80] = bytes(60)
    path.write_bytes(data)
    assert "damaged after" in refusal(arguments, capsys)
    assert core_main(["recover", str(place.folder)]) == 0
    assert len(read_dataset(place.folder / "dataset.json").collections) in (5, 6, 7)


def test_a_full_disk_leaves_the_collections_before_it(place, capsys, monkeypatch):
    from atom_calibration.collect import collector as collect

    written = collect.write_data_file

    def full(folder, sensor, key, data):
        if (sensor.name, key) == ("lidar", "002"):
            monkeypatch.setattr("os.fsync", broken)
        return written(folder, sensor, key, data)

    def broken(*_):
        raise OSError(28, "No space left on device")

    monkeypatch.setattr(collect, "write_data_file", full)
    line = refusal(place(), capsys)
    assert "lidar_002.pcd" in line and "no space left" in line and "free some space" in line
    monkeypatch.undo()
    assert core_main(["recover", str(place.folder)]) == 0
    assert len(read_dataset(place.folder / "dataset.json").collections) == 2


def test_results_are_not_replaced_unless_asked(place, capsys):
    arguments = place()
    assert main(arguments) == 0
    before = (place.folder / "dataset.json").read_bytes()
    assert "--overwrite" in refusal(arguments, capsys)
    assert (place.folder / "dataset.json").read_bytes() == before
    assert main([*arguments, "--overwrite"]) == 0
    collections = json.loads((place.folder / "dataset.json").read_text())["collections"]
    assert len(collections) == STOPS


def test_messages_that_a_driver_sends_out_of_order_are_put_into_it(place, make, monkeypatch):
    """By threes, the last one first."""
    content, held, stamps_s = [], {}, {}
    for topic, message, time_s in messages(make):
        of_topic = held.setdefault(topic, [])
        of_topic.append(message)
        if topic.startswith("/tf") or len(of_topic) == 3:
            content += [(topic, m, time_s) for m in reversed(of_topic)]
            of_topic.clear()
    label = FrameLabeler.label

    def noted(self, frame, tree=None):
        stamps_s.setdefault(frame.sensor.name, []).append(frame.stamp_s)
        return label(self, frame, tree)

    monkeypatch.setattr(FrameLabeler, "label", noted)
    assert main(place(content)) == 0
    assert set(stamps_s) == {"cam", "lidar"}
    for of_sensor in stamps_s.values():
        assert len(of_sensor) == 75 and of_sensor == sorted(of_sensor)


def test_times_before_a_gap_have_their_data(place, make):
    """Of a recording that was cut to its stops: after each nothing comes for seconds."""
    kept = [m for m in messages(make) if m[0] == "/tf_static" or (m[2] - 100.0) % 2.5 < 0.85]
    apart = [(topic, m, time_s) for topic, m, time_s in kept if not 102.4 < time_s < 104.9]
    assert main([*place(apart), "--times", "100.7", "105.7"]) == 0
    assert len(read_dataset(place.folder / "dataset.json").collections) == 2
