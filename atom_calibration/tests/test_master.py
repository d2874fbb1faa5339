"""Nodes without a master, and nodes whose master goes or is restarted: one sentence, and an end."""

import json
import os
import signal
import socket
import subprocess
import sys
import time
from pathlib import Path

import pytest
from masters import reserved_port, start_master

from atom_core.io.config_yaml import write_config
from atom_core.io.dataset_writer import write_dataset_folder
from atom_core.synthetic import scenes

pytestmark = pytest.mark.slow
pytest.importorskip("rospy")

SCRIPTS = Path(__file__).resolve().parents[1] / "scripts"
PATIENCE_S = 300.0
MORTAL_MASTER = """
import os, sys, time
from rosmaster.master import Master
from rosmaster.master_api import ROSMasterHandler

port, last = int(sys.argv[1]), sys.argv[2]

def mortal(register):
    def dies(self, caller, name, *others):
        if name == last:
            os._exit(0)
        return register(self, caller, name, *others)
    return dies

for kind in ("registerService", "registerSubscriber", "registerPublisher"):
    setattr(ROSMasterHandler, kind, mortal(getattr(ROSMasterHandler, kind)))
Master(port).start()
time.sleep(1e6)
"""
NODES = (
    *("rgb_labeler", "depth_labeler", "lidar3d_labeler", "labelers", "collect_data"),
    *("set_initial_estimate", "transform_corrector", "decompress_images", "filter_bag_tf"),
    *("start_bag", "calibrate"),
)
WAITING = ("labelers", "collect_data", "decompress_images")


@pytest.fixture(scope="module")
def inputs(tmp_path_factory):
    """Words that each program can run with."""
    folder = tmp_path_factory.mktemp("nodes")
    scene = scenes.random_scene(2, rgb=1, depth=1, lidar3d=1, collections=3)
    dataset = write_dataset_folder(scene.dataset, folder / "dataset", name="scene")
    config = folder / "config.yml"
    write_config(config, scene.dataset.config)
    description = folder / "rig.urdf"
    description.write_text(rig_description(scene.dataset.config), "utf-8")
    (pattern,) = scene.dataset.patterns
    return {
        **{
            f"{m}_labeler": ["-cfg", config, "-sn", f"{m.replace('3d', '')}_1"]
            for m in ("rgb", "depth", "lidar3d")
        },
        "labelers": ["-cfg", config],
        "collect_data": ["-c", config, "-o", folder / "collected", "--overwrite"],
        "set_initial_estimate": ["-c", config, "-d", description],
        "transform_corrector": ["-json", dataset, "-p", pattern],
        "decompress_images": ["/camera/image_raw/compressed"],
        "filter_bag_tf": [],
        "start_bag": ["-cfg", config, "--player", "/play"],
        "calibrate": ["-json", dataset, "-o", folder / "results", "-rv"],
        "folder": folder,
    }


@pytest.fixture
def port():
    with reserved_port() as number:
        yield number


def rig_description(config):
    """Return a URDF with the edges of a configuration, all poses zero."""
    edges = set()
    for entry in config.sensors.values():
        edges |= {(config.world_link, entry.parent_link), (entry.parent_link, entry.child_link)}
        edges |= {(entry.child_link, entry.link)}
    edges = sorted(edge for edge in edges if edge[0] != edge[1])
    links = sorted({name for edge in edges for name in edge})
    joint = '<joint name="{1}_joint" type="fixed"><parent link="{0}"/><child link="{1}"/></joint>'
    bodies = [f'<link name="{name}"/>' for name in links]
    return f"<robot name='rig'>{''.join(bodies + [joint.format(*e) for e in edges])}</robot>"


def start(name, words, port, folder):
    return subprocess.Popen(
        [sys.executable, str(SCRIPTS / name), *map(str, words)],
        env={**os.environ, "ROS_MASTER_URI": f"http://localhost:{port}", "ROS_HOME": str(folder)},
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )


def wait_until(condition, what):
    end = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < end, f"not within {PATIENCE_S:g} s: {what}"
        time.sleep(0.1)


def ends(process, name, code, words):
    """Demand that a node ends with one sentence of its own."""
    _, said = process.communicate(timeout=PATIENCE_S)
    lines = [line for line in said.splitlines() if line.startswith(f"{name}:")]
    assert (process.returncode, len(lines)) == (code, 1), f"{name}: {process.returncode}\n{said}"
    assert any(word in lines[0] for word in words)
    assert "Traceback" not in said, said


@pytest.mark.long
def test_without_a_master_each_node_says_so_and_ends(inputs, port):
    nodes = {name: start(name, inputs[name], port, inputs["folder"]) for name in NODES}
    for name, process in nodes.items():
        ends(process, name, 2, ("no ROS master answers; start one with roscore, or use roslaunch",))


@pytest.mark.sampled(1)
@pytest.mark.parametrize("again", [False, True], ids=["gone", "restarted"])
def test_a_node_whose_master_is_gone_or_another_says_so_and_ends(inputs, port, again):
    import rosgraph

    folder = inputs["folder"]
    master = start_master(port, folder)
    nodes = {name: start(name, inputs[name], port, folder) for name in WAITING}
    try:
        known = rosgraph.Master("/test_master", master_uri=f"http://localhost:{port}")
        wait_until(
            lambda: (
                {service for service, _ in known.getSystemState()[2]}
                >= {
                    f"/{name}/set_logger_level"  # the last that rospy begins
                    for name in ("rgb_1_labeler", "depth_1_labeler", "lidar_1_labeler", *WAITING)
                }
            ),
            "every node has begun",
        )
        master.kill()
        master.wait()
        if again:
            master = start_master(port, folder)
        gone = (
            "no longer answers"  # which is true for a moment of a master that is started again, too
        )
        said = ("was restarted", gone) if again else (gone,)
        for name, process in nodes.items():
            code = 2 if name == "collect_data" else 1  # it has nothing that could be written
            ends(process, name, code, said)
        status = json.loads((folder / "collected" / "status.json").read_text("utf-8"))
        assert status["exit_code"] == 2
    finally:
        for process in (*nodes.values(), master):
            if process.poll() is None:
                process.send_signal(signal.SIGKILL)
                process.wait()


@pytest.mark.sampled(1)
@pytest.mark.parametrize(
    "last",
    [
        "/rosout",
        "/tf_static",
        *(
            pytest.param(name, marks=pytest.mark.long)
            for name in ("/collect_data/get_loggers", "/collect_data/set_logger_level", "/tf")
        ),
    ],
)
def test_a_node_whose_master_dies_while_it_registers_ends(inputs, port, last):
    """rospy tries to register for ever; the node has to end nevertheless."""
    folder = inputs["folder"]
    program = folder / "mortal_master.py"
    program.write_text(MORTAL_MASTER, "utf-8")
    master = subprocess.Popen([sys.executable, str(program), str(port), last])
    try:
        wait_until(lambda: not socket.socket().connect_ex(("localhost", port)), "it answers")
        node = start("collect_data", inputs["collect_data"], port, folder)
        try:
            ends(node, "collect_data", 2, ("no longer answers",))
        finally:
            node.kill()
            node.wait()
        assert master.wait(PATIENCE_S) == 0, "it died of something else"
    finally:
        master.kill()
        master.wait()
