"""A long session of the live collector: the same stops again and again, with ever rising stamps.

Run below a master; writes ``figures.json``, what became of the saves and how much memory each
node held after each play, anew after each. A play is one stop at each place of the board.

Usage: long_session.py OUTPUT_FOLDER PLAYS SECONDS_OF_A_STOP {keep,delete}
"""

import json
import sys
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import rospy
from live_scene import COLLECTIONS, LiveRig, LiveScene, Process
from node_memory import memory_mb

from atom_calibration.msg import CollectorState
from atom_calibration.srv import DeleteCollection, SaveCollection

NODE = "/collect_data"
_START_S, _STOP_WITHIN_S = 180.0, 300.0  # reached by what is broken only
_US = "/long_session"
_PACE_S = 0.05  # hours of data in fewer hours: as fast as the labelers are, four times at most


class Session:
    """The rig, the collector, and what is noted of both."""

    def __init__(self):
        """Begin with nothing."""
        self.state, self.launch = None, None
        self.refused, self.memory_mb = [], []

    def start(self, folder, stop_s):
        """Start the collector, and show it the rig until all sensors have labels."""
        self._stop_s = stop_s
        scene = LiveScene()
        config = scene.write_config(folder / "config.yml")
        rospy.Subscriber(f"{NODE}/state", CollectorState, self._keep)
        self.launch = Process(
            *("roslaunch", "atom_calibration", "collect_data.launch", f"config:={config}"),
            *(f"output_folder:={folder / 'dataset'}", "rviz:=false"),
        )
        self.rig = LiveRig(scene, pace_s=_PACE_S)
        self.rig.show_until(COLLECTIONS[0], self._all_see, _START_S, lambda: self.state)

    def end(self):
        """End the collector as a user does."""
        if self.launch is not None:
            self.launch.end()

    def _keep(self, state):
        self.state = state

    def _all_see(self):
        state = self.state
        seen = [[p.detected for p in s.patterns] for s in state.sensors] if state else []
        return bool(seen) and all(patterns == [True] for patterns in seen)

    def play(self):
        """Stop at each place and save; return the names of the collections."""
        names = []
        for key in COLLECTIONS:
            self._show(key, self.rig.stamp_s + self._stop_s)
            answer = self._save(key)
            if answer.success:
                names.append(answer.collection_name)
            else:
                self.refused.append(answer.message)
        return names

    def _show(self, key, end_s):
        self.rig.show_until(key, lambda: self.rig.stamp_s > end_s, _STOP_WITHIN_S, lambda: "a stop")

    def _save(self, key):
        ask = rospy.ServiceProxy(f"{NODE}/save_collection", SaveCollection)
        with ThreadPoolExecutor(1) as pool:
            answer = pool.submit(ask)
            self.rig.show_until(key, answer.done, _STOP_WITHIN_S, lambda: "the answer to a save")
            return answer.result()

    def delete(self, names):
        """Delete collections again."""
        for name in names:
            answer = rospy.ServiceProxy(f"{NODE}/delete_collection", DeleteCollection)(name)
            if not answer.success:
                self.refused.append(answer.message)

    def note_memory(self):
        """Note how much memory [MB] each node holds."""
        self.memory_mb.append(memory_mb(_US))


def main():
    """Run the session."""
    folder, plays, stop_s = Path(sys.argv[1]), int(sys.argv[2]), float(sys.argv[3])
    rospy.init_node(_US.strip("/"))
    session = Session()
    figures = {"saved": 0, "memory_mb": session.memory_mb, "refused": session.refused}
    try:
        session.start(folder, stop_s)
        for _ in range(plays):
            names = session.play()
            figures["saved"] += len(names)
            if sys.argv[4] == "delete":
                session.delete(names)
            session.note_memory()
            figures["ran_to_the_end"] = session.launch.is_running()
            (folder / "figures.json").write_text(json.dumps(figures), encoding="utf-8")
    finally:
        session.end()


if __name__ == "__main__":
    main()
